"""What our launch files use of ROS 2's launch, with the same names and arguments (tests/facts/launch.yaml).

An action is visited with the context of the launch; it returns further actions, or nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from .substitution import Substitution, perform


class LaunchContext:
    """Context of a launch. Attributes: launch_configurations, values of arguments by name; is_shutdown, whether it is
    ending; service, which carries it out."""

    def __init__(self, *, argv: Sequence[str] | None = None, noninteractive: bool = False):
        self.argv = list(argv or ())
        self.launch_configurations: dict[str, str] = {}
        self.is_shutdown = False
        self.service: LaunchService | None = None

    def perform_substitution(self, substitution: Substitution) -> str:
        """Return the text that a substitution stands for."""
        return substitution.perform(self)


class LaunchDescriptionEntity:
    """What a launch description consists of."""

    def visit(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity] | None:
        """Do what it stands for; returns what is to be visited next."""
        raise NotImplementedError


class LaunchDescription(LaunchDescriptionEntity):
    """A list of actions."""

    def __init__(self, initial_entities: Iterable[LaunchDescriptionEntity] = (), *, deprecated_reason: str = ""):
        self.entities = list(initial_entities)

    def visit(self, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        """Return the actions."""
        return self.entities

    def get_launch_arguments(self) -> list:
        """Return its `DeclareLaunchArgument`s and those of included launch files, each name once."""
        found: dict[str, LaunchDescriptionEntity] = {}
        for argument in _declared(self):
            found.setdefault(argument.name, argument)
        return list(found.values())


def _declared(description: LaunchDescription) -> Iterator:
    from .actions import DeclareLaunchArgument, IncludeLaunchDescription

    for entity in description.entities:
        if isinstance(entity, DeclareLaunchArgument):
            yield entity
        elif isinstance(entity, IncludeLaunchDescription):
            yield from _declared(entity.launch_description_source.get_launch_description(LaunchContext()))


from .service import LaunchService  # noqa: E402  # which needs the classes above

__all__ = ["LaunchContext", "LaunchDescription", "LaunchDescriptionEntity", "LaunchService", "Substitution", "perform"]
