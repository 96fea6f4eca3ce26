"""The presets of conf/, read without `config`: a path follows the class by interpolation."""

import json
from pathlib import Path as FilePath
from typing import Annotated

from omegaconf import OmegaConf
from pydantic import Field, TypeAdapter

from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.ego import Ego
from stixel_cli.scene.parameters import Path, RoadUser, World

CONF = FilePath(__file__).parents[2] / "conf"


def options(group: str) -> list[str]:
    return sorted(file.stem for file in (CONF / group).glob("*.yaml"))


ROAD_USERS = options("road_user")
PATHS = [path for path in options("path") if path != "recorded"]  # needs a folder
EGOS = options("ego")


def load(group: str, option: str, schema, **others):
    tree = OmegaConf.create({group: OmegaConf.load(CONF / group / f"{option}.yaml"), **others})
    plain = OmegaConf.to_container(tree, resolve=True)[group]
    return TypeAdapter(schema).validate_json(json.dumps(plain))


def road_user(option: str) -> RoadUser:
    return load("road_user", option, RoadUser)


def path(option: str, road_user_option: str) -> Path:
    presets = OmegaConf.load(CONF / "pace" / f"{road_user_option}.yaml")
    return load("path", option, Annotated[Path, Field(discriminator="kind")], pace=presets)


def ego(option: str) -> Ego:
    return load("ego", option, Annotated[Ego, Field(discriminator="kind")])


def rig(option: str) -> Rig:
    return load("rig", option, Rig)


def world() -> World:
    return load("world", "street", World)
