# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures of robots in MuJoCo, all with the same floor, lights and colours.

A picture shows a movement as a photograph of several exposures does: bodies at the end, pale at other times, and the ways of points as
tubes. Shadows on the floor say how far away each part is. Needs a display or MUJOCO_GL=egl.
"""

from __future__ import annotations

from typing import Any

import mujoco  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Width and height of a picture in pixels. It is rendered at twice this size, which smooths edges and shadows.
SIDE = 720
#: Colours of ways, that of the main one first: red and green of `pictures.COLOURS`.
WAYS = [(0.85, 0.28, 0.2), (0.22, 0.6, 0.35)]
#: Most geoms in a scene: tubes have a geom for each piece.
GEOMS = 5000


def stage(spec: Any, size: float, floor: float) -> None:
    """Adds a floor at this height, which touches nothing, to a model of this size in metres, and replaces its lights."""
    visual, world = spec.visual, spec.worldbody
    for light in list(spec.lights):
        spec.delete(light)
    visual.global_.offwidth, visual.global_.offheight = 2 * SIDE, 2 * SIDE
    visual.quality.shadowsize = 8192
    visual.headlight.ambient, visual.headlight.diffuse, visual.headlight.specular = [0.35] * 3, [0.25] * 3, [0.1] * 3
    visual.rgba.haze = [0.93, 0.95, 0.98, 1]
    sky = {"rgb1": [0.80, 0.86, 0.93], "rgb2": [0.93, 0.95, 0.98], "width": 256, "height": 1536}
    spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, **sky)
    tiles = {"rgb1": [0.80, 0.82, 0.85], "rgb2": [0.74, 0.77, 0.80], "width": 512, "height": 512}
    spec.add_texture(name="tiles", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER, **tiles)
    material = spec.add_material(name="floor", texrepeat=[2 / size, 2 / size], texuniform=True, specular=0.1, shininess=0.1)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, pos=[0, 0, floor], size=[0, 0, size / 4], material="floor", rgba=[1] * 4, contype=0, conaffinity=0)
    sun = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    world.add_light(type=sun, pos=[0.5 * size, -0.4 * size, floor + size], dir=[-0.5, 0.4, -1], diffuse=[0.62] * 3, specular=[0.3] * 3)
    spec.stat.extent, spec.stat.center = size, [0, 0, floor + size / 2]
    visual.map.shadowclip = 2


class Scene:
    """A picture in the making: bodies and ways are added, then it is saved."""

    def __init__(self, spec: Any, *, size: float, floor: float = 0.0, target: list[float], distance: float, azimuth: float, elevation: float) -> None:
        """Of a robot of this size in metres; the camera is `distance` metres away from `target`."""
        stage(spec, size, floor)
        self.model = spec.compile()
        self.renderer = mujoco.Renderer(self.model, 2 * SIDE, 2 * SIDE, GEOMS)
        self.scene = self.renderer.scene
        self.ghosts: list[tuple[Any, float]] = []
        self.camera = mujoco.MjvCamera()
        self.camera.lookat, self.camera.distance, self.camera.azimuth, self.camera.elevation = target, distance, azimuth, elevation

    def body(self, place: Any) -> None:
        """Shows all bodies, with the joints at these positions; comes before ways."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = place
        mujoco.mj_forward(self.model, data)
        self.renderer.update_scene(data, self.camera)

    def ghost(self, place: Any, opacity: float) -> None:
        """Shows the moving bodies once more, pale."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = place
        mujoco.mj_forward(self.model, data)
        self.ghosts.append((data, opacity))

    def way(self, points: Any, radius: float, colour: int = 0, opacity: float = 1.0) -> None:
        """Shows the way along these points as a tube."""
        rgba = np.array([*WAYS[colour], opacity], np.float32)
        for one, other in zip(points, points[1:]):
            geom = self.scene.geoms[self.scene.ngeom]
            mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
            mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, radius, one, other)
            self.scene.ngeom += 1

    def save(self, file: str) -> None:
        """Writes the picture as PNG."""
        import matplotlib.image

        # An exposure for each ghost: transparent bodies would show their inner parts, and cast shadows as dark as those of solid ones.
        alone, count = self.renderer.render().astype(float), self.scene.ngeom
        pixels = alone.copy()
        for data, opacity in self.ghosts:
            mujoco.mjv_addGeoms(self.model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), mujoco.mjtCatBit.mjCAT_DYNAMIC, self.scene)
            pixels += opacity * (self.renderer.render() - alone)
            self.scene.ngeom = count
        pixels = pixels.clip(0, 255).reshape(SIDE, 2, SIDE, 2, 3).mean(axis=(1, 3))
        matplotlib.image.imsave(file, pixels.round().astype(np.uint8))
        self.renderer.close()
