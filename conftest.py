"""Imports the packages before any test does.

In importlib mode pytest calls `midastouch_filter/test/x.py` the module `midastouch_filter.test.x`: its parent
would be the folder in the workspace, not the package of that name inside it, unless that is loaded already.
"""

import digit_driver  # noqa: F401
import midastouch_bringup  # noqa: F401
import midastouch_filter  # noqa: F401
import midastouch_perception  # noqa: F401
