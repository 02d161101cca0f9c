"""Base class of this project's lifecycle nodes."""

from __future__ import annotations

import contextlib
import gc
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from ..errors import InputError
from ..stop_signals import interruptible
from . import diagnostics
from .node import PipelineNode, refuse_unused_overrides
from .parameters import Parameter, Parameters
from .private_rclpy import RCLError

AUTOSTART = Parameter("autostart", True, "Configure and activate at start, without a lifecycle manager", at_start=True)
"""Parameter of every lifecycle node."""

INACTIVE = "the node is not active; activate it (ros2 lifecycle set)"
"""Reason that a node that is not active gives when it refuses a request."""

_UNCONFIGURED = "not configured (ros2 lifecycle set)"


class ManagedNode(PipelineNode, LifecycleNode, ABC):
    """Lifecycle node that reports what it is loading, and why loading failed.

    A subclass makes its publishers and services in its constructor, which ends with `autostart()`. An impossible
    transition is answered with `success: false`; in rclpy it raises out of the executor, so that any client could end
    the process.

    Attributes: failure, the reason why the last transition failed or the node gave up; otherwise empty.

    table: the node's parameters. Those that are neither `at_start` nor changeable at run time can change while the node
    is unconfigured, so that you can correct the name of a file and configure again. gone: as in `Parameters`.
    """

    def __init__(
        self, name: str, table: Iterable[Parameter], gone: Mapping[str, str] = MappingProxyType({}), **node_options
    ):
        super().__init__(name, **node_options)
        self.failure = ""
        self._doing, self._starting = _UNCONFIGURED, False
        self._error: Exception | None = None
        self._before: set | None = None  # subscriptions and timers made before `connect`; None while not connected
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._change_state_or_refuse
        try:
            self.parameters = Parameters(self, table, lambda: self.lifecycle_state == "unconfigured", gone)
        except InputError:
            self.destroy_node()
            raise
        self._lasting = diagnostics.LastingWarnings(self)
        self.diagnostics = diagnostics.Diagnostics(self, self._describe_state)

    def autostart(self) -> None:
        """Configure and activate if the parameter `autostart` is set. On failure raises InputError or another error."""
        if not self.parameters["autostart"]:
            self.say(_UNCONFIGURED)
            return
        self._starting = True
        try:
            for transition in (self.trigger_configure, self.trigger_activate):
                if transition() is not TransitionCallbackReturn.SUCCESS:
                    raise self._error
        except BaseException:
            self.destroy_node()
            raise
        self._starting = False

    @property
    def lifecycle_state(self) -> str:
        """Label of the current state, e.g. `active`."""
        return self._state_machine.current_state[1]

    @property
    def active(self) -> bool:
        """True while the node does its work."""
        return self.lifecycle_state == "active"

    def say(self, doing: str) -> None:
        """Report in the diagnostics what the node does or waits for, until it is active."""
        self._doing = doing
        self.diagnostics.publish()

    @contextlib.contextmanager
    def busy(self, doing: str) -> Iterator[None]:
        """Report in the diagnostics what the active node is loading inside; a signal to stop breaks the loading off."""
        self._doing = doing
        try:
            with self.diagnostics.kept_up(), interruptible():
                yield
        finally:
            self._doing = ""

    @abstractmethod
    def configure(self) -> None:
        """Load the files that the parameters name, and `say` so first; raises InputError.

        A signal to stop can break it off anywhere, so it must not start anything that `unload` has to end.
        """

    @abstractmethod
    def connect(self) -> None:
        """Make subscriptions and timers; raises InputError.

        The base destroys them when the node stops being active: a matched subscription means an active node.
        """

    def disconnect(self) -> None:
        """End everything that `connect` has begun except subscriptions and timers, which the base destroys."""

    @abstractmethod
    def unload(self) -> None:
        """Release what `configure` has loaded, even if it loaded only a part."""

    @abstractmethod
    def describe(self) -> tuple[bytes, str, dict]:
        """Return level, message and values for the diagnostics of the active node."""

    def obstacles(self) -> Mapping[str, str]:
        """Return, by kind, what keeps the active node from its work; it is logged if it lasts."""
        return {}

    def has_warned(self, kind: str) -> bool:
        """Return whether this kind of obstacle has been logged and is not over."""
        return self._lasting.has_logged(kind)

    def destroy_node(self) -> None:
        """Disconnect, then destroy the node as rclpy does."""
        self._disconnect()
        super().destroy_node()
        # otherwise the state machine keeps the underlying node visible until it is collected
        self._state_machine.destroy_when_not_in_use()
        gc.unfreeze()  # loaded objects can be collected again, now or when Python ends

    # --- transitions, called by rclpy

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._carry_out(self._configure_or_unload, "configured, but not active (ros2 lifecycle set)")

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        result = self._carry_out(self._connect, "")
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info("active")
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._carry_out(self._disconnect, "deactivated")

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._carry_out(self._let_go, _UNCONFIGURED)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._carry_out(self._disconnect_and_unload, "shut down")

    def _carry_out(self, transition: Callable[[], None], doing: str) -> TransitionCallbackReturn:
        """Run a transition and return its result. Reports the reason of a failure, which rclpy swallows, or `doing`."""
        self.failure = ""
        try:
            transition()
        except Exception as error:
            return self._fail(error)
        if doing and not self._starting:
            self.say(doing)
        else:
            self._doing = doing
        return TransitionCallbackReturn.SUCCESS

    def _configure_or_unload(self) -> None:
        try:
            with self.diagnostics.kept_up(), interruptible():
                self.configure()
                # Loaded objects last as long as the node: searching them for garbage would delay some answers.
                gc.collect()
                gc.freeze()
        except BaseException:
            self._let_go()
            raise

    def _connect(self) -> None:
        """Connect; if that fails, disconnect again before raising."""
        self._before = {*self.subscriptions, *self.timers}
        try:
            self.connect()
            refuse_unused_overrides(self)
        except Exception:
            self._disconnect()
            raise

    def _disconnect(self) -> None:
        """Disconnect, even if only a part is connected; a no-op when the node is not connected."""
        if self._before is None:
            return
        self.disconnect()
        for subscription in {*self.subscriptions} - self._before:
            self.destroy_subscription(subscription)
        for timer in {*self.timers} - self._before:
            self.destroy_timer(timer)
        self._before = None

    def _disconnect_and_unload(self) -> None:
        self._disconnect()
        self._let_go()

    def _let_go(self) -> None:
        gc.unfreeze()
        self.unload()

    def _fail(self, error: Exception) -> TransitionCallbackReturn:
        """Report a transition's failure and return it; the node stays in the state it was in before."""
        expected = isinstance(error, InputError)
        self.failure = str(error) if expected else f"{type(error).__name__}: {error}"
        if self._starting:
            self._error = error  # `autostart` raises it, and its caller reports it
        else:
            trace = "" if expected else "\n" + "".join(traceback.format_exception(error)).rstrip()
            self.get_logger().error(f"{self.failure}{trace}")
        self.say(self.failure)
        return TransitionCallbackReturn.FAILURE

    def _describe_state(self) -> tuple[bytes, str, dict]:
        state = {"lifecycle": self.lifecycle_state}
        if self.failure:
            return diagnostics.ERROR, self.failure, state
        if self._doing:
            return diagnostics.WARN, self._doing, state
        self._lasting.observe(self.obstacles())
        level, message, values = self.describe()
        return level, message, {**state, **values}

    def _change_state_or_refuse(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            return self._change_state(request, response)
        except RCLError:
            wanted = request.transition.label or f"transition {request.transition.id}"
            self.get_logger().warning(f"{wanted} is not possible while {self.lifecycle_state}")
            response.success = False
            return response
