"""Conformance of renderers: sunlight, and its reflection by materials."""

from __future__ import annotations

import numpy as np

from posse_core._model.spacecraft import Material
from posse_core.testing import scenes
from posse_core.testing.closed_forms import disc_share, lambertian_sphere, polygon_area_and_centroid
from posse_core.testing.stage import (
    CLAY,
    COLOUR,
    SIDES,
    WHITE,
    RendererStage,
    ball,
    body,
    centroid,
    facing,
    lambert,
    one_part,
    pixels,
    project,
    wall,
)


class LightConformance(RendererStage):
    """Lambert's law, direction, shadow, penumbra, eclipse, textures, normal maps."""

    def test_lambertian_plate(self) -> None:
        """E ρ/π cos θ in each band, for any angle of incidence."""
        with self.opened(wall(CLAY)) as stage:
            for theta in (0.0, 0.5, 1.2):
                frame = facing(sun=(np.sin(theta), 0.0, np.cos(theta)))
                self.assert_radiance(stage.shot(frame), lambert(frame, COLOUR, np.cos(theta)))

    def test_both_sides_of_a_face_are_seen(self) -> None:
        """A plate whose front faces away from camera and Sun is as bright as one that faces them."""
        plate = scenes.rectangle("plate", "clay", u_m=(9.0, 0, 0), v_m=(0, -9.0, 0))
        with self.opened(one_part(plate, material=CLAY)) as stage:
            frame = facing(sun=(0.5, 0.0, 1.0))
            cosine = 1 / np.hypot(1.0, 0.5)
            self.assert_radiance(stage.shot(frame), lambert(frame, COLOUR, cosine))

    def test_lambertian_sphere(self) -> None:
        """Radiance over the disc of a sphere, at three phase angles."""
        scene = one_part(
            scenes.sphere("ball", "white"), material=WHITE, camera=scenes.camera(48, 48, 0.6)
        )
        with self.opened(scene) as stage:
            for phase in (0.0, 1.0, 2.0):
                frame = facing(sun=(np.sin(phase), 0.0, np.cos(phase)))
                image = stage.shot(frame)
                expected = lambertian_sphere(scene.camera, frame, radius_m=1.0)
                total = expected.sum(axis=(0, 1))
                np.testing.assert_allclose(
                    image.radiance_rgb.sum(axis=(0, 1)),
                    total,
                    rtol=self.radiance_tolerance,
                    err_msg=(
                        "a white ball reflects another amount than E/π cos θ: is π missing, or light "
                        "lost or added at the limb?"
                    ),
                )
                error = np.abs(image.radiance_rgb - expected)[image.coverage > 0.999]
                assert error.mean() < 2 * self.radiance_tolerance * expected.max(), (
                    "the light is not spread over a ball as cos θ: are normals interpolated, and "
                    "shadows free of stripes?"
                )

    def test_light_is_proportional_to_irradiance(self) -> None:
        with self.opened(wall(CLAY)) as stage:
            sun, flux_w_m2 = (0.3, 0.2, 1.0), scenes.SOLAR_FLUX_W_M2
            once = stage.shot(facing(sun)).radiance_rgb
            thrice = stage.shot(facing(sun, solar_flux_w_m2=3 * flux_w_m2))
            half = stage.shot(facing(sun, sun_fraction=0.5)).radiance_rgb
            np.testing.assert_allclose(
                thrice.radiance_rgb.mean(),
                3 * once.mean(),
                rtol=2e-3,
                err_msg=(
                    "three times the irradiance does not give three times the light: is there a "
                    "tone curve, a clamp or an exposure?"
                ),
            )
            np.testing.assert_allclose(
                half.mean(),
                0.5 * once.mean(),
                rtol=2e-3,
                err_msg=(
                    "half the Sun's visible share does not give half the light: is "
                    "sun_irradiance_rgb_w_m2 used, which includes it?"
                ),
            )

    def test_eclipse_is_black_and_still_covers(self) -> None:
        with self.opened(ball()) as stage:
            lit = stage.shot(facing(sun=(1.0, 0.0, 1.0)))
            dark = stage.shot(facing(sun=(1.0, 0.0, 1.0), sun_fraction=0.0))
            assert dark.radiance_rgb.max() == 0.0, (
                "there is light in the Earth's shadow: an ambient term, or a Sun that is not "
                "scaled by its visible share"
            )
            np.testing.assert_allclose(
                dark.coverage,
                lit.coverage,
                atol=0.1,
                err_msg="coverage changes with the light: it is geometry alone",
            )

    def test_the_lit_side_faces_the_sun(self) -> None:
        with self.opened(ball()) as stage:
            for side, sun_cam in SIDES.items():
                image = stage.shot(facing(sun=body(sun_cam)))
                offset = centroid(image.radiance_rgb.sum(axis=-1)) - centroid(image.coverage)
                assert offset @ sun_cam[:2] > 1.0, f"the Sun is {side}, the light is not"
                assert abs(offset @ [sun_cam[1], sun_cam[0]]) < 0.5, (
                    "the light is off to one side: is the Sun's direction in camera axes, x right "
                    "and y down?"
                )

    def test_the_night_side_is_dark(self) -> None:
        with self.opened(ball()) as stage:
            image = stage.shot(facing(sun=(0.0, 0.0, -1.0)))
            peak = lambert(facing(sun=(0.0, 0.0, 1.0)), WHITE.base_color, 1.0).max()
            assert image.radiance_rgb[image.coverage > 0.999].max() < 0.002 * peak, (
                "the night side is lit: is n·l clamped at a small positive number, or is there "
                "an ambient term?"
            )

    def test_a_shadow_falls_where_the_sun_throws_it(self) -> None:
        """A plate 0.5 m above a wall casts its shadow beside it when the Sun is oblique."""
        wall = scenes.rectangle("wall", "white", u_m=(9.0, 0, 0), v_m=(0, 9.0, 0))
        plate = scenes.rectangle(
            "plate", "white", centre_m=(0.3, 0.2, 0.5), u_m=(0.15, 0, 0), v_m=(0, 0.1, 0)
        )
        scene = scenes.scene(wall, plate, materials=(WHITE,), camera=scenes.camera())
        for sun in ((1.0, 0.5, 1.0), (-0.8, 1.0, 1.0)):
            with self.opened(scene) as stage:
                frame = facing(sun=sun)
                image = stage.shot(frame).radiance_rgb.mean(axis=-1)
            shadow = np.array([0.3, 0.2, 0.0]) - 0.5 * np.array([sun[0], sun[1], 0.0]) / sun[2]
            square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
            corners = shadow + [0.15, 0.1, 0] * square
            area, middle = polygon_area_and_centroid(project(scene.camera, frame, corners))
            near = np.hypot(*(np.moveaxis(pixels(image), -1, 0) - middle[:, None, None])) < 9
            darkness = np.where(near, 1 - image / np.median(image), 0)
            np.testing.assert_allclose(
                centroid(darkness),
                middle,
                atol=0.3,
                err_msg=(
                    "the shadow is not where the Sun throws it: is it offset along normals (a "
                    "bias), or its map too coarse?"
                ),
            )
            np.testing.assert_allclose(
                darkness.sum(),
                area,
                rtol=0.1,
                err_msg=(
                    "the shadow is not as large or as dark as it should be: is it filtered, or "
                    "light let through?"
                ),
            )

    def test_a_penumbra_is_as_wide_as_the_suns_disc(self) -> None:
        """Capability ``path-traced``: in the penumbra of a straight edge, radiance is in proportion to
        the visible share of the Sun's disc."""
        if "path-traced" not in self.capabilities:
            return
        alpha, height_m = 0.1, 2.0
        wall = scenes.rectangle("wall", "white", u_m=(9.0, 0, 0), v_m=(0, 9.0, 0))
        roof = scenes.rectangle(  # black and behind the camera, so that it only blocks the Sun
            "roof", "black", centre_m=(-5.0, 0, height_m), u_m=(5.0, 0, 0), v_m=(0, 9.0, 0)
        )
        black = Material("black", base_color=(0.0, 0.0, 0.0), specular=0.0)
        scene = scenes.scene(wall, roof, materials=(WHITE, black), camera=scenes.camera(64, 8, 0.6))
        frame = scenes.frame(
            t_body_cam_m=(0.0, 0.0, 1.5), sun_direction_body=(0, 0, 1), sun_angular_radius_rad=alpha
        )
        with self.opened(scene) as stage:
            profile = stage.shot(frame).radiance_rgb.mean(axis=(0, 2))
        x_m = 1.5 * scene.camera.rays(pixels(np.zeros((1, 64))))[0, :, 0]
        expected = disc_share(x_m / (height_m * np.tan(alpha)))
        peak = lambert(frame, WHITE.base_color, 1.0).mean()
        assert np.abs(profile / peak - expected).max() < 0.25, (
            "a pixel in the penumbra is not as bright as the visible share of the Sun's "
            "disc: is the Sun a point?"
        )
        assert np.abs(profile / peak - expected).mean() < 0.05, (
            "the penumbra is not as wide as the Sun's disc: is sun_angular_radius_rad its "
            "radius and not its diameter?"
        )

    def test_texture_is_the_right_way_up_and_srgb(self) -> None:
        """Row 0 is at v = 1 and u points to the right; the linear value of the code is multiplied by the
        factor."""
        code = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [188, 188, 188]]], dtype=np.uint8)
        texture = np.kron(code, np.ones((16, 16, 1), dtype=np.uint8))
        material = Material("print", base_color=COLOUR, specular=0.0, base_color_texture=texture)
        plate = scenes.rectangle("plate", "print", u_m=(1.0, 0, 0), v_m=(0, 1.0, 0))
        scene = one_part(plate, material=material)
        with self.opened(scene) as stage:
            frame = facing(sun=(0.0, 0.0, 1.0))
            image = stage.shot(frame).radiance_rgb
        quarters = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [-0.5, -0.5, 0], [0.5, -0.5, 0]])
        linear = np.where(code == 188, 0.50289, code / 255).reshape(4, 3)
        centres_px = project(scene.camera, frame, quarters).round().astype(int)
        for (u, v), share in zip(centres_px, linear, strict=True):
            expected = lambert(frame, COLOUR, 1.0) * share
            np.testing.assert_allclose(
                image[v - 2 : v + 3, u - 2 : u + 3].mean(axis=(0, 1)),
                expected,
                rtol=2 * self.radiance_tolerance,
                atol=2e-3 * lambert(frame, COLOUR, 1.0).max(),
                err_msg=(
                    "a quarter of the texture is wrong: row 0 is at v = 1, codes are sRGB, and the "
                    "factor multiplies the linear value"
                ),
            )

    def test_metallic_roughness_texture_multiplies_the_factors(self) -> None:
        """A uniform texture acts as a factor; its channels are metallic, then roughness."""
        texture = np.full((8, 8, 2), (255, 128), dtype=np.uint8)
        printed = Material("m", COLOUR, 1.0, 0.8, metallic_roughness_texture=texture)
        plain = Material("m", COLOUR, 1.0, 0.8 * 128 / 255)
        images = []
        for material in (printed, plain):
            with self.opened(ball(material)) as stage:
                images.append(stage.shot(facing(sun=(0.3, 0.0, 1.0))).radiance_rgb)
        np.testing.assert_allclose(
            images[0].sum(),
            images[1].sum(),
            rtol=0.02,
            err_msg=(
                "a uniform texture of metallic and roughness gives another amount of light than "
                "the factors: are channels metallic, then roughness, linear, and times the "
                "factors?"
            ),
        )
        peak = images[1].max()
        assert np.abs(images[0] - images[1]).mean() < 0.02 * peak, (
            "a uniform texture of metallic and roughness gives another lobe than the "
            "factors: is roughness read from the second channel?"
        )

    def test_metal_reflects_and_does_not_scatter(self) -> None:
        """Under a black sky a smooth metal plate is dark except where it reflects the Sun."""
        metal = Material("metal", COLOUR, metallic=1.0, roughness=0.15)
        with self.opened(wall(metal)) as stage:
            aside = facing(sun=(3.0, 0.0, 1.0))
            mirrored = facing(sun=(0.0, 0.0, 1.0))
            diffuse = lambert(mirrored, COLOUR, 1.0)
            assert (stage.shot(aside).radiance_rgb.mean(axis=(0, 1)) < 0.05 * diffuse).all(), (
                "smooth metal scatters light aside: it has no diffuse part; is metallic ignored?"
            )
            assert (stage.shot(mirrored).radiance_rgb.mean(axis=(0, 1)) > diffuse).all(), (
                "smooth metal does not mirror the Sun: is it drawn as a diffuse surface?"
            )

    def test_normal_map_tilts_towards_u_and_v(self) -> None:
        tilt = 0.4
        for axis in (0, 1):
            normal = np.array([0.0, 0.0, np.cos(tilt)])
            normal[axis] = np.sin(tilt)
            texture = np.full((8, 8, 3), np.round((normal + 1) / 2 * 255), dtype=np.uint8)
            bumpy = Material("bumpy", base_color=COLOUR, specular=0.0, normal_texture=texture)
            with self.opened(wall(bumpy)) as stage:
                for sign in (1.0, -1.0):
                    sun = np.array([0.0, 0.0, np.cos(0.5)])
                    sun[axis] = sign * np.sin(0.5)
                    frame = facing(sun=tuple(sun))
                    np.testing.assert_allclose(
                        stage.shot(frame).radiance_rgb.mean(axis=(0, 1)),
                        lambert(frame, COLOUR, float(normal @ sun)),
                        rtol=0.03,
                        err_msg=(
                            "a normal map tilts another way: t = (n + 1)/2, +x along u, +y along v "
                            "(OpenGL style), on both sides of a face"
                        ),
                    )
