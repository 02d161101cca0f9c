"""Stand-in for tf2_ros of Jazzy, the part of it that our packages use: same names, arguments and answers."""

from .buffer import Buffer as Buffer
from .buffer import ConnectivityException as ConnectivityException
from .buffer import ExtrapolationException as ExtrapolationException
from .buffer import InvalidArgumentException as InvalidArgumentException
from .buffer import LookupException as LookupException
from .buffer import TransformException as TransformException
from .transform_listener import TransformListener as TransformListener
