"""The sub-commands of `midastouch`, one module each: `add_parser(subparsers)` and `run(args) -> int`.

Everything beyond the standard library is imported inside `run`, so that `midastouch --help` answers at once and
`midastouch doctor` works while something is missing.
"""
