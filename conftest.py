"""Settings for every test of the workspace."""

from hypothesis import settings

# the first example of a test may have to compile a kernel, so time says nothing about the code
settings.register_profile("workspace", deadline=None, derandomize=True)
settings.load_profile("workspace")
