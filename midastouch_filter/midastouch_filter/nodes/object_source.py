"""Objects to localise on: those of the parameters at the start, and those that `set_object` names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.output_paths import codebook_path
from midastouch_common.ros.addresses import require_within, resolve
from midastouch_common.ros.parameters import Parameters
from midastouch_perception.codebook import Codebook, build_command, require_sensor
from midastouch_perception.objects import bundled_objects

from ..core.config import FilterConfig
from ..core.presets import PAPER
from ..identification.catalogue import Catalogue, read_catalogue
from ..loaded_object import LoadedObject, coarse_codebook


@dataclass(frozen=True)
class NewObject:
    """An object that was read, and the address of its mesh for viewers."""

    loaded: LoadedObject
    address: str | Path


class ObjectSource:
    """Source of objects: `load(mesh_path, codebook_path, config, seed, paper)` reads mesh and codebook; without a
    codebook, `build(mesh_path, network, sensor_model, config, seed, paper)` makes one. All methods raise InputError."""

    def __init__(
        self,
        load: Callable[..., LoadedObject],
        build: Callable[..., LoadedObject],
        parameters: Parameters,
        config: FilterConfig,
    ):
        self._load, self._build, self._parameters, self._config = load, build, parameters, config
        self._sensor, self._paper = parameters["sensor_model"], parameters["preset"] == PAPER
        self._folders = [resolve(f, "object_folders") for f in parameters["object_folders"].split(":") if f]

    def initial(self) -> NewObject | None:
        """Return the object of the parameters `mesh` and `codebook`; None if they are empty."""
        mesh, codebook = self._parameters["mesh"], self._parameters["codebook"]
        return self._read(mesh, codebook) if mesh or codebook else None

    def catalogue(self) -> Catalogue | None:
        """Return the objects of the parameter `objects`; None if it is empty."""
        if not (given := self._parameters["objects"]):
            return None
        self._require_catalogue_possible()

        def build(path: Path) -> tuple[ObjectMesh, Codebook]:
            return coarse_codebook(path, self._parameters["tcn"], self._sensor, self._config)

        sources = [self._named(address.strip()) for address in given.split(",")]
        try:
            return read_catalogue(sources, build, self._config, self._sensor)
        except OSError as error:  # a folder that may not be entered, a name too long
            raise InputError(f"objects: cannot read {given}: {error}") from error

    def _named(self, address: str) -> Path:
        """Return the path of one of `objects`; a bundled object's is that of its codebook or, without, of its mesh."""
        if address not in bundled_objects():
            return resolve(address, "objects")
        codebook = codebook_path(address, self._sensor).resolve()
        return codebook if codebook.is_file() else bundled_objects()[address]

    def _require_catalogue_possible(self) -> None:
        if self._parameters["mesh"] or self._parameters["codebook"]:
            raise InputError("objects, and mesh or codebook: which object is it? Give either of them")
        if self._parameters["init_mode"] != "uniform":
            raise InputError("objects: a pose can be given on a known object only; set init_mode to uniform")
        if self._paper:
            raise InputError("objects: the paper's filter has to know the object; set preset to balanced or fast")
        if not self._config.refinement:
            raise InputError("objects: distinguished by their penetration maps; set refinement to true")

    def requested(self, mesh: str, codebook: str, network_id: str) -> NewObject:
        """Return the object that a service call asks for, which must lie in the folders that the parameters allow.

        network_id: network of the incoming codes, "" if none has come yet. A codebook of another network is refused,
        because none of these codes could be used.
        """
        for address, what in ((mesh, "mesh"), *([(codebook, "codebook")] if codebook else [])):
            require_within(address, resolve(address, what), self._folders)
        new = self._read(mesh, codebook)
        theirs = new.loaded.network_id
        if theirs and network_id and theirs != network_id:
            fix = "build it again" if codebook else "set the parameter tcn of this node"
            raise InputError(
                f"{codebook or mesh}: built with the network {theirs}, but the codes that come are of {network_id}; "
                f"{fix}, or restart tcn with that network first"
            )
        return new

    def _read(self, mesh: str, codebook: str) -> NewObject:
        path, seed = resolve(mesh, "mesh"), self._parameters["seed"]
        try:
            if codebook:
                loaded = self._load_or_say_how_to_build(path, resolve(codebook, "codebook"), seed)
                if loaded.sensor is not None:
                    require_sensor(loaded.sensor, self._sensor, codebook)
            else:
                loaded = self._build(path, self._parameters["tcn"], self._sensor, self._config, seed, self._paper)
        except OSError as error:  # a folder that may not be entered, a name too long
            raise InputError(f"cannot read {mesh} with {codebook or 'no codebook'}: {error}") from error
        return NewObject(loaded, mesh if "://" in mesh else path)

    def _load_or_say_how_to_build(self, mesh: Path, codebook: Path, seed: int) -> LoadedObject:
        try:
            return self._load(mesh, codebook, self._config, seed, self._paper)
        except InputError as error:
            if not mesh.is_file() or codebook.is_file():
                raise
            name = next((name for name, path in bundled_objects().items() if path.samefile(mesh)), mesh)
            command = build_command(name, self._sensor, self._parameters["tcn"], codebook)
            raise InputError(f"{codebook}: no such codebook file; check the path, or build it: {command}") from error
