"""What the words in a column's name say, English and German, as test departments and tools write
them (CarMaker, Adams, VI-grade, dSPACE, VBOX).

A word says something of some of these: `part` of the car, `quantity`, `axis`, `axle`, `side`.
Words that say that a column is none of our channels are in NO_CHANNEL, those that say nothing in
SILENT.
"""

from collections.abc import Mapping

Said = Mapping[str, str]


def _table(**rows: tuple[Said, str]) -> dict[str, Said]:
    return {word: said for said, words in rows.values() for word in words.split()}


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


def _corner(axle: str, side: str) -> dict[str, str]:
    return {"axle": axle, "side": side}


_FL, _FR = _corner("front", "left"), _corner("front", "right")
_RL, _RR = _corner("rear", "left"), _corner("rear", "right")

CORNER_WORDS: Mapping[str, Said] = _table(
    fl=(_FL, "fl lf vl lv vli lhf frontleft leftfront vornelinks"),
    fr=(_FR, "fr rf vr rv vre rhf frontright rightfront vornerechts"),
    rl=(_RL, "rl lr hl lh hli lhr rearleft leftrear hintenlinks"),
    rr=(_RR, "rr hr rh hre rhr rearright rightrear hintenrechts"),
)
"""Words for one wheel's corner."""

AXIS_LETTERS: Mapping[str, Said] = {letter: {"axis": letter} for letter in "xyz"}

LETTERS: Mapping[str, Said] = {
    **AXIS_LETTERS,
    "a": {"quantity": "acceleration"},
    "v": {"quantity": "velocity"},
    "f": {"quantity": "force"},
    "t": {"quantity": "time"},
    **{
        f"{letter}{axis}": {"quantity": quantity, "axis": axis}
        for letter, quantity in (
            ("a", "acceleration"),
            ("v", "velocity"),
            ("t", "displacement"),
            ("r", "angle"),
            ("w", "rate"),
            ("f", "force"),
            ("m", "torque"),
        )
        for axis in "xyz"
    },
}
"""Symbols; `tz` is CarMaker's translation along z, `ry` its rotation about y."""

WORDS: Mapping[str, Said] = {
    **_table(
        chassis=(
            {"part": "chassis"},
            "car body chassis sprung cg cog vehicle veh vhcl vhc fzg fahrzeug aufbau karosserie"
            " karo schwerpunkt imu ins",
        ),
        wheel=(
            {"part": "wheel"},
            "wheel wheels whl rad raeder rim felge knuckle upright spindle unsprung wc radnabe nabe"
            " radtraeger radmitte radmittelpunkt carrier axle achse",
        ),
        hub=({"part": "hub"}, "hub"),
        suspension=(
            {"part": "suspension"},
            "susp suspension strut federbein fahrwerk pot potentiometer stringpot potis lvdt"
            " seilzug",
        ),
        jounce=(
            {"part": "suspension", "quantity": "travel"},
            "jounce einfederung einfederweg federweg einfeder",
        ),
        spring=({"part": "spring"}, "spring springs feder"),
        damper=({"part": "damper"}, "damper damp daempfer dampfer shock absorber"),
        tyre=({"part": "tyre"}, "tyre tire tyr reifen"),
        load=(
            {"part": "tyre", "quantity": "force"},
            "radlast aufstandskraft wheelload tireload tyreload",
        ),
        road=({"part": "road"}, "road strasse fahrbahn ground boden profile profil"),
        post=({"part": "post"}, "post actuator aktuator shaker stempel pulser zylinder cylinder"),
        brake=({"part": "brake"}, "brake brk bremse brems"),
        drive=({"part": "drive"}, "drive driving drv antrieb antriebs halfshaft"),
        driver=({"point": "driver"}, "driver fahrer"),
        passenger=({"point": "passenger"}, "passenger beifahrer"),
        seat=({"part": "seat"}, "seat sitz sitzschiene"),
        stabilizer=(
            {"part": "stabilizer"},
            "arb stabi stabilizer stabiliser stabilisator antiroll sway swaybar",
        ),
        arm=({"part": "arm"}, "arm lenker laengslenker"),
        displacement=(
            {"quantity": "displacement"},
            "disp displ displacement displacements pos position weg height hoehe hgt stroke"
            " elevation niveau auslenkung verschiebung",
        ),
        travel=({"quantity": "travel"}, "travel deflection"),
        distance=(
            {"quantity": "displacement", "axis": "x"},
            "distance dist strecke wegstrecke fahrstrecke fahrweg odometer odo sroad",
        ),
        angle=({"quantity": "angle"}, "angle angles ang winkel wkl neigung inclination"),
        rate=({"quantity": "rate"}, "rate gyro gyr omega drehrate angvel"),
        velocity=(
            {"quantity": "velocity"},
            "vel velocity velocities speed spd geschw geschwindigkeit tempo",
        ),
        acceleration=(
            {"quantity": "acceleration"},
            "acc accel acceleration accelerations accn beschl beschleunigung",
        ),
        deceleration=(
            {"quantity": "acceleration", "axis": "x", "sense": "against"},
            "decel deceleration verzoegerung",
        ),
        force=({"quantity": "force"}, "force forces frc kraft load last"),
        torque=({"quantity": "torque"}, "torque trq moment mom drehmoment"),
        time=(
            {"quantity": "time"},
            "time zeit uhrzeit timestamp timestamps zeitstempel zeitkanal times elapsed",
        ),
        heave=({"axis": "z"}, "heave bounce vertical vert vertikal hoch huben hubbewegung"),
        longitudinal=(
            {"axis": "x"},
            "longitudinal long lon lng longi laengs laengsrichtung forward fwd",
        ),
        lateral=({"axis": "y"}, "lateral lat quer querrichtung"),
        pitch=({"axis": "pitch"}, "pitch pit ptch nick nicken theta"),
        roll=({"axis": "roll"}, "roll rol rolling wank wanken phi"),
        front=({"axle": "front"}, "front frt frnt vorn vorne vorder vorderachse va"),
        rear=({"axle": "rear"}, "rear back hinten hinter hinterachse ha"),
        left=({"side": "left"}, "left links li lt lhs"),
        right=({"side": "right"}, "right rechts re rt rhs"),
        carmaker_fl=({"part": "wheel", **_FL}, "cfl"),
        carmaker_fr=({"part": "wheel", **_FR}, "cfr"),
        carmaker_rl=({"part": "wheel", **_RL}, "crl"),
        carmaker_rr=({"part": "wheel", **_RR}, "crr"),
    ),
    **CORNER_WORDS,
    **LETTERS,
}
"""What each word says."""

NO_CHANNEL = _words(
    "steer steering lenk lenkrad lenkwinkel lenkung yaw gier gieren psi temp temperature temperatur"
    " pressure druck rpm drehzahl gear gang current strom voltage spannung status flag counter"
    " zaehler target soll setpoint sollwert error fehler slip schlupf camber sturz toe spur caster"
    " latitude longitude heading course kurs satellites sats fuel battery throttle pedal gaspedal"
    " clutch engine motor jerk ruck power leistung energy quality crc checksum index"
    " lambda abs esp trigger lap runde"
)
"""Words of columns that are no channel of ours."""

SILENT = _words(
    "mass masse centre center ctr mitte sensor signal sig ch chan channel kanal meas measured mess"
    " messung ist value val wert raw roh filt filtered gefiltert global inertial earth coorsys"
    " sys gps can log data daten of the at in am an der des die und and de op poi trans real sim"
    " dyn con mot s e string wire cable trailing"
)
"""Words that say nothing about which channel it is."""
