"""Imports the packages before any test does.

In pytest's importlib mode `midastouch_filter/test/x.py` is the module `midastouch_filter.test.x`, whose parent
would be the folder in the workspace, not the package of the same name inside it, unless that is loaded already.
"""

import digit_driver  # noqa: F401
import midastouch_bringup  # noqa: F401
import midastouch_filter  # noqa: F401
import midastouch_perception  # noqa: F401
