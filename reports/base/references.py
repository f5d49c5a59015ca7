"""References of a report, numbered in the order in which the text cites them.

A text cites by name, ``[@Nairn 2003]``; once the whole text is known, numbers take the place of the names.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from reports.base.format import breakable

#: What the reports cite, by name.
REFERENCES: dict[str, str] = {
    "Hu 2018": "Hu, Y., et al. (2018). A moving least squares material point method with displacement discontinuity "
    "and two-way rigid body coupling. ACM Trans. Graph. 37(4):150. doi:10.1145/3197517.3201293",
    "Stomakhin 2012": "Stomakhin, A., Howes, R., Schroeder, C., Teran, J. M. (2012). Energetically consistent "
    "invertible elasticity. Proc. Symp. Computer Animation, 25-32.",
    "Simo 1987": "Simo, J. C. (1987). On a fully three-dimensional finite-strain viscoelastic damage model. "
    "Comput. Methods Appl. Mech. Eng. 60:153-173. doi:10.1016/0045-7825(87)90107-1",
    "Nairn 2003": "Nairn, J. A. (2003). Material point method calculations with explicit cracks. Comput. Model. Eng. "
    "Sci. 4:649-663.",
    "Hillerborg 1976": "Hillerborg, A., Modéer, M., Petersson, P.-E. (1976). Analysis of crack formation and crack "
    "growth in concrete. Cem. Concr. Res. 6:773-781. doi:10.1016/0008-8846(76)90007-7",
    "Turon 2007": "Turon, A., Dávila, C. G., Camanho, P. P., Costa, J. (2007). An engineering solution for mesh size "
    "effects in the simulation of delamination using cohesive zone models. Eng. Fract. Mech. 74:1665-1682. "
    "doi:10.1016/j.engfracmech.2006.08.025",
    "Atkins 2009": "Atkins, T. (2009). The Science and Engineering of Cutting. Butterworth-Heinemann.",
    "Chouly 2013": "Chouly, F., Hild, P. (2013). A Nitsche-based method for unilateral contact problems. SIAM J. "
    "Numer. Anal. 51:1295-1307. doi:10.1137/12088344X",
    "Stefan 1874": "Stefan, J. (1874). Versuche über die scheinbare Adhäsion. Sitzungsber. Akad. Wiss. Wien, "
    "Math.-Naturwiss. Kl. 69:713-735.",
    "Raous 1999": "Raous, M., Cangémi, L., Cocou, M. (1999). A consistent model coupling adhesion, friction, and "
    "unilateral contact. Comput. Methods Appl. Mech. Eng. 177:383-399. doi:10.1016/S0045-7825(98)00389-2",
    "Kennedy 2001": "Kennedy, M. C., O'Hagan, A. (2001). Bayesian calibration of computer models. J. R. Statist. Soc. "
    "B 63:425-464. doi:10.1111/1467-9868.00294",
    "Raue 2009": "Raue, A., et al. (2009). Structural and practical identifiability analysis of partially observed "
    "dynamical models by exploiting the profile likelihood. Bioinformatics 25:1923-1929. "
    "doi:10.1093/bioinformatics/btp358",
    "Koh 2026": "Koh, H., Song, C.-Y., Choi, Y., Viveiros, M., Hyde, D., Kim, H. (2026). CulinaryCut-VLAP: a "
    "vision-language-action-physics framework for food cutting via a force-aware material point method. "
    "arXiv:2601.06451",
    "Dawood 2026": "Dawood et al. (2026). Hyperelastic characterisation of silicone tissue phantoms. Data, CC BY 4.0.",
    "Gneiting 2007": "Gneiting, T., Raftery, A. E. (2007). Strictly proper scoring rules, prediction, and estimation. "
    "J. Am. Stat. Assoc. 102:359-378. doi:10.1198/016214506000001437",
    "ASME V&V 20": "ASME V&V 20 (2009). Standard for verification and validation in computational fluid dynamics and "
    "heat transfer. American Society of Mechanical Engineers.",
    "ASME V&V 40": "ASME V&V 40 (2018). Assessing credibility of computational modeling through verification and "
    "validation: application to medical devices. American Society of Mechanical Engineers.",
    "ISO 18571": "ISO/TS 18571 (2014). Road vehicles: objective rating metric for non-ambiguous signals.",
    "Schwer 2007": "Schwer, L. E. (2007). Validation metrics for response histories. Eng. Comput. 23:295-309. "
    "doi:10.1007/s00366-007-0070-1",
    "Schwarz 1978": "Schwarz, G. (1978). Estimating the dimension of a model. Ann. Statist. 6:461-464. "
    "doi:10.1214/aos/1176344136",
    "Kass 1995": "Kass, R. E., Raftery, A. E. (1995). Bayes factors. J. Am. Stat. Assoc. 90:773-795. "
    "doi:10.1080/01621459.1995.10476572",
    "Sobol 2001": "Sobol, I. M. (2001). Global sensitivity indices for nonlinear mathematical models. Math. Comput. "
    "Simul. 55:271-280. doi:10.1016/S0378-4754(00)00270-6",
}
#: References of foods that the reports cite as well, by their short names in materials.yaml.
CITED_TOO = {"CulinaryCut": "Koh 2026"}
_CITED = re.compile(r"\[@([^]]+)\]")


def of_foods(found: Mapping[str, str]) -> list[list[str]]:
    """The references of foods as rows: short name, and full text; one that is in the numbered list has its number."""
    return [
        [breakable(name), breakable(f"[@{CITED_TOO[name]}] {text}" if name in CITED_TOO else text)]
        for name, text in found.items()
    ]


class Citations:
    """Numbers for what is cited, from one on in the order of citation."""

    def __init__(self) -> None:
        self._names: list[str] = []

    def numbered(self, content: Any) -> Any:
        """The same texts with numbers in place of names.

        Args:
            content: A text, or texts in lists and dictionaries, in the order in which they are read; anything else is
                kept.

        Returns:
            The same with ``[1]`` in place of ``[@Name 2000]``.

        Raises:
            KeyError: A name that has no reference.
        """
        if isinstance(content, str):
            return _CITED.sub(lambda m: f"[{self._number(m[1])}]", content)
        if isinstance(content, dict):
            return {key: self.numbered(one) for key, one in content.items()}
        return [self.numbered(one) for one in content] if isinstance(content, list) else content

    @property
    def listed(self) -> list[str]:
        """The references that were cited, in the order of their numbers."""
        return [REFERENCES[name] for name in self._names]

    def _number(self, name: str) -> int:
        if name not in REFERENCES:
            raise KeyError(f"{name} is cited and has no reference")
        if name not in self._names:
            self._names.append(name)
        return self._names.index(name) + 1
