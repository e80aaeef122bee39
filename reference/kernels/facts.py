"""All facts about kernels, in the order in which ci/kernels proves them."""
import facts_bricks  # noqa: F401
import facts_geometry  # noqa: F401
from kernels import FACTS, FILES, Kernels  # noqa: F401
