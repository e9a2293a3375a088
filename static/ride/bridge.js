// Runs in viser's page before viser does: lets the page around it pose the scene without a server.
//
// window.bridge.inject(messages) hands messages to viser as if its server had sent them.
// The page hears `viewer` events on its own window: {state: "connected" | "closed"} and
// {state: "scene", names} when the server has (re)built nodes, after which poses must be sent again,
// and {state: "grip", phase, name, position} while a handle is dragged.
// Rests on private ways of viser 1.1.1: its worker's messages. tests/browser holds it to them.
(() => {
  const NativeWorker = window.Worker;
  let socket = null;
  let names = new Set();

  const tell = (detail) =>
    window.parent.dispatchEvent(new window.parent.CustomEvent("viewer", { detail }));

  // viser reconnects only while its document has the focus, which a frame seldom has.
  document.hasFocus = () => true;
  // Below 36 em viser shows a bottom sheet; ours has no panel at any width.
  const matchMedia = window.matchMedia.bind(window);
  window.matchMedia = (query) => matchMedia(/max-width/.test(query) ? "not all" : query);

  const listen = (event) => {
    const data = event.data;
    if (data.type === "connected") {
      names = new Set();
      tell({ state: "connected" });
    } else if (data.type === "closed") {
      tell({ state: "closed" });
    } else if (data.type === "message_batch") {
      const made = data.messages.filter((m) => m.props && /Message$/.test(m.type) && m.name);
      made.forEach((m) => names.add(m.name));
      const replayed = data.messages.some((m) => m.type === "ReplayDoneMessage");
      if (made.length || replayed) tell({ state: "scene", names: [...names] });
    }
  };

  window.Worker = class extends NativeWorker {
    postMessage(message, transfer) {
      if (message?.type === "set_server") {
        socket = this;
        this.addEventListener("message", (event) => {
          if (!event.injected) setTimeout(listen, 0, event);
        });
      }
      const said = message?.type === "send" ? message.message : null;
      const grip = /^TransformControls(DragStart|Update|DragEnd)Message$/.exec(said?.type);
      if (grip) tell({ state: "grip", phase: grip[1], name: said.name, position: said.position });
      return super.postMessage(message, transfer);
    }
  };

  // The page's own keys work while the 3D view has the focus; the camera keeps W A S D Q E.
  const passed = new Set([" ", "ArrowLeft", "ArrowRight", "Home", "End", "?", "Escape"]);
  document.addEventListener(
    "keydown",
    (event) => {
      const palette = (event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "k";
      if (!palette && !passed.has(event.key)) return;
      event.stopImmediatePropagation();
      event.preventDefault();
      if (palette) return;
      window.parent.document.dispatchEvent(
        new window.parent.KeyboardEvent("keydown", { key: event.key, shiftKey: event.shiftKey }),
      );
    },
    true,
  );

  window.bridge = {
    get ready() {
      return socket !== null;
    },
    /** Connect anew at once instead of at the next try. */
    retry() {
      socket?.postMessage({ type: "retry" });
    },
    inject(messages) {
      if (!socket) return false;
      // Typed arrays must be of this window's own kind, or three.js does not know them.
      const own = messages.map((m) => (m.updates ? structuredClone(m) : m));
      const event = new MessageEvent("message", { data: { type: "message_batch", messages: own } });
      event.injected = true;
      socket.dispatchEvent(event);
      return true;
    },
  };
})();
