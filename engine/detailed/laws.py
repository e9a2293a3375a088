"""Force laws as Exudyn evaluates them: recorded once as expressions, then run in C++.

An expression takes the exact arguments that Exudyn names for a connector. `math` is
`exudyn.symbolic`; its `max` and `IfThenElse` are the only branches.
"""

from collections.abc import Callable
from typing import Any

from ..frames import CREEP_SPEED
from .records import BushingLaw, Damper, Stop, Strut, TyreData

Law = Callable[..., Any]


def bushing_law(law: BushingLaw, speed: float, math: Any) -> Law:
    """Force and torque (6,) on the first body, towards the second (docs/detailed-car.md)."""

    def per_axis(axis: int, u: Any, v: Any) -> Any:
        k, s = law.stiffness[axis], law.scale[axis]
        if k == 0.0:
            return 0.0 * u
        through = v / speed
        damping = k * law.time_constant * v / math.sqrt(1.0 + through * through)
        return k * u * (1.0 + (u / s) * (u / s)) + damping

    def force(
        mbs: Any,
        t: Any,
        itemNumber: Any,
        displacement: Any,
        rotation: Any,
        velocity: Any,
        angularVelocity: Any,
        stiffness: Any,
        damping: Any,
        rotJ0: Any,
        rotJ1: Any,
        offset: Any,
    ) -> list[Any]:
        pushed = [per_axis(k, displacement[k], velocity[k]) for k in range(3)]
        return pushed + [per_axis(3 + k, rotation[k], angularVelocity[k]) for k in range(3)]

    return force


def damper_law(strut: Strut, math: Any) -> Law:
    """Tension, N, of damper and stops; deltaL is how far it is longer than by design, m."""

    def force(
        mbs: Any,
        t: Any,
        itemNumber: Any,
        deltaL: Any,
        deltaL_t: Any,
        stiffness: Any,
        damping: Any,
        force: Any,
    ) -> Any:
        stops = _stop(strut.rebound_stop, deltaL, math) - _stop(strut.bump_stop, -deltaL, math)
        return _damper(strut.damper, deltaL_t, math) + stops

    return force


def _damper(damper: Damper, rate: Any, math: Any) -> Any:
    """Tension of the damper alone at a rate of lengthening."""
    through = rate / damper.speed
    c = math.IfThenElse(rate > 0.0, damper.rebound + 0.0 * rate, damper.bump + 0.0 * rate)
    return c * rate / math.sqrt(1.0 + through * through)


def _stop(stop: Stop, travel: Any, math: Any) -> Any:
    """Force of a stop against travel towards it."""
    d = math.max(travel - stop.gap, 0.0 * travel)
    return stop.stiffness * d + stop.cubic * d * d * d


def brake_law(radius: float, math: Any) -> Law:
    """Torque, N m, on the wheel against its turning in the carrier: B tanh(r spin / v0).

    damping : B, which a driver sets
    """

    def torque(
        mbs: Any,
        t: Any,
        itemNumber: Any,
        rotation: Any,
        angularVelocity: Any,
        stiffness: Any,
        damping: Any,
        offset: Any,
    ) -> Any:
        return damping * math.tanh(radius * angularVelocity / CREEP_SPEED)

    return torque


def tyre_law(tyre: TyreData, math: Any) -> Law:
    """Force (3,) on the ground; the wheel's vertical load is its z with the opposite sign.

    displacement : of the wheel centre less the connector's offset, whose z is the road's height
    damping[2] : rate of the road's height
    """

    def force(
        mbs: Any,
        t: Any,
        itemNumber: Any,
        displacement: Any,
        velocity: Any,
        stiffness: Any,
        damping: Any,
        offset: Any,
    ) -> list[Any]:
        squeeze = tyre.free_radius - displacement[2]
        load = tyre.stiffness * squeeze + tyre.damping * (damping[2] - velocity[2])
        nothing = 0.0 * displacement[0]
        return [nothing, nothing, -math.max(load, 0.0 * load)]

    return force
