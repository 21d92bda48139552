"""Path following of periodic orbits and of their special points."""

import jaxcam as jaxcam  # 64-bit floats
