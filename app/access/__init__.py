"""Who may do what, and from where: hosts, pages, links, cookies, keys, proxies, sessions."""
