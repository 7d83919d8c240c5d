"""The letter's figures from this system's own cameras and placements, as SVG and PNG, the same bytes every time.

Needs Matplotlib, which comes with the extra ``plots``.
"""

from hsop_gcs.study.figures.gallery import FIGURES, draw

__all__ = ["FIGURES", "draw"]
