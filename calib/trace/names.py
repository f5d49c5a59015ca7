"""What the name of a measured column says: its quantity, its unit, its sign, and whether it was measured at all."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from calib.table.table import Table
from calib.table.units import Quantity, Unit, is_unit, split_unit, unit_of

_OF_THE_TEST = r"(_(test|d_essai|de_ensayo|di_prova|do_ensaio|measurement|standard|estandar|traverse|traversa))?"
"""What machines write behind the name of a quantity."""
_STEMS = {
    "time": (
        re.compile(
            rf"((test|run|relative|elapsed|total|measurement|sample|log|publish|record(ed)?|receive|system|sensor)_)?time"
            rf"{_OF_THE_TEST}|t|(time|elapsed)_?stamp|elapsed(_time)?|date_?time|stamp|(column|unnamed)_\d+"
        ),
    ),
    "force": (
        re.compile(rf"(.*_)?(force|load|load_?cell|resistance|f|fz)(_z)?(_?\d)?{_OF_THE_TEST}|(.*_)?wrench_z|last"),
    ),
    "position": (
        re.compile(r"((ee|knife|tool|tcp|blade)_)?(z|height|position|pos)(_z)?"),
        re.compile(
            rf"(.*_)?(stroke|displacement|disp|displ|travel|depth|extension|penetration|distance|crosshead){_OF_THE_TEST}"
        ),
    ),
    "compression": (
        re.compile(r"gap"),
        re.compile(
            r"(.*_)?(compression|stroke|displacement|disp|displ|travel|extension|distance|depth|crosshead)"
            rf"{_OF_THE_TEST}"
        ),
    ),
}
_DEPTH = _STEMS["position"][1]
_MEASURED = "actual|act|current|measured|meas"
_EITHER_WAY = re.compile(
    rf"(({_MEASURED}|robot|flange|eef|ee|end_effector|knife|tool|tcp|blade)_)*(z|height|position|pos|pos(e|ition)?_z|"
    rf"z_(position|pos|height|axis)|gap|deformation|ext|lvdt)"
    rf"(_({_MEASURED}))*|(.*_)?(crosshead|cross_head|traverse|axial|actuator|ram|piston|machine)_(position|pos|absolute)|"
    r"(crosshead_)?separation|s"
)
"""Names of the knife's place that say nothing of the direction in which it is counted, which the force then tells. They
are looked for where no name of ``_STEMS`` is there."""
_FALLING = _STEMS["compression"][0]
_KNOWN_FORCE = {"base_fz": -1.0, "knife_fz": 1.0}
"""Columns whose sign is known: robot logs hold the force on the world in the base frame, downwards negative."""
KNOWN = {"force": tuple(_KNOWN_FORCE), "position": ("ee_z",), "time": ("stamp",)}
"""Stems that are preferred to others of the same role. A ROS message's own stamp is the time of its measurement, the
other clock in its file that of its recording."""
_ROS = (
    (re.compile(r"field\.(.*\.)?stamp"), "stamp", "ns"),
    (re.compile(r"%time"), "time", "ns"),
    (re.compile(r"/(.*/)?stamp"), "stamp", "s"),
    (re.compile(r"(.*[./_])?header[./_]stamp"), "stamp", "s"),
    (re.compile(r"__time"), "time", "s"),
    (re.compile(r"X_Value"), "time", "s"),
    (re.compile(r"(.*[./])?O_F_ext_hat_K([./].*force[./]z|[.\[_]?2\]?)", re.IGNORECASE), "base_fz", "N"),
    (re.compile(r"(.*[./])?K_F_ext_hat_K([./].*force[./]z|[.\[_]?2\]?)", re.IGNORECASE), "knife_fz", "N"),
    (re.compile(r"(.*[./])?O_T_EE([./].*position[./]z|[.\[_]?14\]?)", re.IGNORECASE), "ee_z", "m"),
    (re.compile(r"(.*[./])?(actual_TCP_force|ft_raw_wrench)[.\[_]?2\]?"), "force_z", "N"),
    (re.compile(r"(.*[./])?actual_TCP_pose[.\[_]?2\]?"), "position_z", "m"),
    (re.compile(r"(.*[./])?force[./]z"), "force_z", "N"),
    (re.compile(r"(.*[./])?position[./]z"), "position_z", "m"),
    (re.compile(r"/(.*/)?translation/z"), "translation_z", "m"),
)
"""Names that programs write whose units are known without being written: text exports of ROS messages, which are in SI
(REP 103) and whose clocks are known by the program (``rostopic echo -p`` nanoseconds, PlotJuggler and LabVIEW seconds),
and the outputs of Universal Robots' RTDE."""
_RTDE = re.compile(r"actual_(TCP|q|joint|current)")
_NOT_MEASURED = re.compile(
    r"(^|_)(target|cmd|command|commanded|desired|des|setpoint|set_?point|goal|ref|reference|nominal|limit|lim|thresh(old)?|"
    r"max|maximum|min|minimum|mean|avg|average|median|rms|std|sd|var|peak|upper|lower|err|error|residual|"
    r"norm|abs|magnitude|dot|rate|deriv(ative)?|delta|diff|filt|filtered|smooth|smoothed|pred|predicted|fit|fitted|sim|"
    r"simulated|model|offset|bias|tare)(_|\d|$)"
)
"""Words in the name of a column that is commanded, or made of measured ones: such a column is never chosen unasked."""
_JOINT_TORQUES = re.compile(
    r"^base_f|^knife_f([xyz]|_?ext)?(_|$)|(^|_)[ok]_f_ext|external_wrench|ext(ernal)?_wrench|wrench_ext|external_force|(^|_)ext_force|"
    r"(^|_)force_ext|(^|_)f_ext|(wrench|force)_est|est(imated)?_(wrench|force)|actual_tcp_force|cartesian_(wrench|force)|"
    r"endpoint_state_wrench"
)
"""Names of wrenches that arms estimate from the torques or currents of their joints: libfranka, Kinova, KUKA, Sawyer,
Universal Robots."""
COUNTERS = frozenset(
    "frame_index frame frames frame_number sample samples sample_index sample_number index counter count seq n i step "
    "row field_header_seq".split()
)
"""Stems of columns that count samples."""
_WORDS = {
    word: english
    for english, words in {
        "time": (
            "prüfzeit messzeit versuchszeit zeit temps tiempo tempo tijd czas время 試験時間 试验时间 時間 时间 時刻 "
            "시간"
        ),
        "force": (
            "standardkraft prüfkraft schneidkraft schnittkraft kraft belastung effort fuerza carga forza carico força "
            "kracht siła "
            "нагрузка усилие сила 試験力 试验力 荷重 载荷 負荷 负荷 力 하중"
        ),
        "displacement": (
            "standardweg traversenweg verfahrweg kolbenweg weg distanz stauchung zusammendrückung déplacement "
            "deplacement course enfoncement desplazamiento recorrido spostamento corsa deslocamento verplaatsing droga "
            "przemieszczenie "
            "перемещение 変位 位移 行程 ストローク 변위"
        ),
        "height": "messerposition messerhöhe werkzeugposition höhe hauteur altura altezza hoogte 高さ 高度",
    }.items()
    for word in words.split()
}
"""Words of other languages in the headers of machines, and what they mean."""
_FOREIGN = re.compile(
    "|".join(
        rf"(?<![^\W_]){word}(?![^\W_])" if word[0] < "\u3000" else word
        for word in sorted(_WORDS, key=len, reverse=True)
    )
)
_OF_UNIT = {Quantity.TIME: "time", Quantity.FORCE: "force", Quantity.LENGTH: "displacement"}
"""What a column is called that has no name but its unit."""
_OF_A_CELL = re.compile(r"(.*_)?(weight|mass)")
"""What a load cell shows that is given in grams; looked for where no force is there."""
LONGEST_NAME = 200
"""Letters from which on the name of a column means nothing."""


@dataclass(frozen=True)
class Meaning:
    """What is known of a column from its name and from what is stated beside it.

    Attributes:
        stem: The name without its unit, in lower case, words joined by _.
        unit: Its unit as it is written, empty where there is none.
        named: The unit in the name itself, empty where there is none.
        stated: Whether the unit stands elsewhere than in the name.
    """

    stem: str
    unit: str
    named: str = ""
    stated: bool = False

    @property
    def measure(self) -> Unit | None:
        """The unit; None where there is none, or none that is known."""
        return unit_of(self.unit) if self.unit else None


def stem_of(name: str) -> str:
    """Lower case, words joined by _; a capital after a small letter begins a word."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z][a-z]|[XYZ](?![A-Za-z]))", "_", name).lower()
    if not apart.isascii() or _FOREIGN.search(apart):
        apart = _FOREIGN.sub(lambda found: _WORDS[found.group()], apart)
    plain = "".join(c for c in unicodedata.normalize("NFKD", apart) if not unicodedata.combining(c))
    stem = re.sub(r"[^a-z0-9]+", "_", plain).strip("_")
    stem = re.sub(r"_\d+_((default|fast|slow)_sample_rate|standardmessrate)$", "", stem)  # of HBM's catman
    return re.sub(r"^(latest|(run|data_set|dataset|test|specimen|probe)_\d+)_(?=[a-z])", "", stem)


def meaning(table: Table, name: str) -> Meaning:
    """Stem and unit of a column: from the unit stated beside its name, the programs' conventions, or its name alone."""
    if len(name) > LONGEST_NAME:
        return Meaning("", "")
    known = next(((s, u) for pattern, s, u in _ROS if pattern.fullmatch(name)), None)
    if known is None and name == "timestamp" and any(_RTDE.match(other) for other in table.columns):
        known = ("time", "s")
    if known is not None:
        stem, usual = known
        return Meaning(stem, table.units.get(name, "") or usual)
    split = split_unit(name)
    within = split_unit(split.stem)  # a unit that is said twice
    stem = within.stem if split.bracketed and unit_of(within.text) == unit_of(split.text) else split.stem
    stem, named = stem_of(stem), split.text
    stated = table.units.get(name, "")
    if not stated:
        quantity = "" if named else _named_by_its_unit(table, name)
        return Meaning(quantity, name, name) if quantity else Meaning(stem, named, named)
    return Meaning(stem if is_unit(named) else stem_of(name), stated, named, stated=True)


def _named_by_its_unit(table: Table, name: str) -> str:
    """What a column is whose name is nothing but a unit; empty for another name.

    ``ms`` and ``seconds`` are clocks. Of ``s``, ``N`` and ``mm`` this is sure only where all names are units.
    """
    unit = unit_of(name)
    if unit is None or unit.quantity is Quantity.OTHER:
        return ""
    if unit.quantity is Quantity.TIME and unit.common and len(name) > 1:
        return "time"
    return _OF_UNIT[unit.quantity] if all(map(is_unit, table.columns)) else ""


def candidates(table: Table, role: str) -> list[str]:
    """Columns whose name and unit fit a role; known ones alone if there are any, and others only if there are none."""
    fitting = [name for name in table.columns if fits(table, name, role)] or fitting_else(table, role)
    fitting = [name for name in fitting if not is_unit(name)] or fitting
    for stem in KNOWN.get(role, ()):
        preferred = [name for name in fitting if meaning(table, name).stem == stem]
        if preferred:
            return preferred
    return fitting


def fits(table: Table, name: str, role: str) -> bool:
    """Whether a column can have a role by its name and unit.

    A ROS stamp that nobody has set, and so stands, is no clock, and what was commanded or derived is no measurement.

    Args:
        table: The table.
        name: Name of the column.
        role: ``time``, ``force``, ``position`` or ``compression``.

    Returns:
        Whether it can.
    """
    said = meaning(table, name)
    measure = said.measure
    if measure is None or not measure.fits(role) or not named_like(said.stem, role):
        return False
    if role == "time" and said.stem == "stamp":
        cells = table.columns[name]
        return any(cell != cells[0] for cell in cells)
    return True


def fitting_else(table: Table, role: str) -> list[str]:
    """Columns that can have a role where no name and unit fit it.

    They are times of the day and dates by any name, the knife's place by a name that does not say in which direction
    it is counted, and a weight in a unit of force.
    """
    if role == "time":
        return [name for name in table.clocks if name in table.columns and not not_measured(name)]
    if role == "position":
        return [name for name in table.columns if counted_either_way(table, name)]
    if role == "force":
        said = {name: meaning(table, name) for name in table.columns}
        cells = [name for name in said if (unit := said[name].measure) and unit.fits("force")]
        return [name for name in cells if _OF_A_CELL.fullmatch(said[name].stem) and not not_measured(name)]
    return []


def named_like(stem: str, role: str) -> bool:
    """Whether a stem is one of a role, and of a measurement."""
    return any(pattern.fullmatch(stem) for pattern in _STEMS[role]) and not not_measured(stem)


def counted_either_way(table: Table, name: str) -> bool:
    """Whether a column is the knife's place by a name that does not say in which direction it is counted."""
    said = meaning(table, name)
    measure = said.measure
    fitting = measure is not None and measure.fits("position") and not not_measured(said.stem)
    return fitting and not named_like(said.stem, "position") and _EITHER_WAY.fullmatch(said.stem) is not None


def not_measured(name: str) -> bool:
    """Whether a name says that its numbers were commanded, or derived from measured ones."""
    return _NOT_MEASURED.search(stem_of(name)) is not None


def from_joint_torques(name: str) -> bool:
    """Whether a force column holds what an arm estimates from its joints, by any name that such columns have."""
    return _JOINT_TORQUES.search(stem_of(name)) is not None


def sign_of(stem: str, role: str) -> float:
    """Sign that the name of a column stands for: a force on the world, a depth as a height, a gap that closes."""
    if role == "force":
        return _KNOWN_FORCE.get(stem, 1.0)
    if role == "position":
        return -1.0 if is_depth(stem) else 1.0
    if role == "compression":
        return -1.0 if _FALLING.fullmatch(stem) else 1.0
    return 1.0


def is_depth(stem: str) -> bool:
    """Whether a stem is that of a way down, which grows as the knife descends, or says nothing of its direction."""
    either = _EITHER_WAY.fullmatch(stem) and not named_like(stem, "position")
    return bool(_DEPTH.fullmatch(stem) or either)
