"""The detailed car: a multibody model with bushings, joints and stops, driven like a prototype.

`read_car` and `reference_car` read its data, `drive` takes it through a manoeuvre. The equations
are set up and solved by Exudyn (the extra `ridetune[detailed]`), which is imported only when a
model is built.
"""
