"""Put the three pictures of a cut side by side: python docs/strip.py runs/cut docs/cut.jpg"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

NAMES = ("contact", "peak", "end")
WIDE = 460  # of each [pixels]
QUALITY = 88  # of the file


def main(run: Path, picture: Path) -> None:
    """Contact, largest force and end from left to right."""
    images = [Image.open(run / f"{name}.png").convert("RGB") for name in NAMES]
    small = [image.resize((WIDE, image.height * WIDE // image.width), Image.Resampling.LANCZOS) for image in images]
    strip = Image.new("RGB", (WIDE * len(small), small[0].height))
    for k, image in enumerate(small):
        strip.paste(image, (k * WIDE, 0))
    strip.save(picture, quality=QUALITY, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
