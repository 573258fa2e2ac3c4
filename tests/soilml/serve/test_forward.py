"""What the forward model of the page answers is what the library computes."""

import numpy as np
import pytest
from conftest import MODEL

from soilml import EFFECTS, Model, Operating, Wheel, soil
from soilml.errors import InputError
from soilml.serve.forward import GEARS, controls, forward


def sliders(request):
    groups = controls(request)["groups"]
    return {control["path"]: control for group in groups for control in group["controls"]}


@pytest.mark.parametrize("slip", [0.3, -0.4])
def test_curves_and_stresses_are_those_of_the_model(slip):
    values = {"slip": slip, "load": 80.0, "shear_modulus": 0.01, "slip-sinkage.n1": 0.4}
    found = forward({"values": values})
    model = Model(Wheel(radius=0.15, width=0.12)) + EFFECTS["slip-sinkage"](n1=0.4)
    ground = soil("wong1989/dry_sand", shear_modulus=0.01)
    own = model(ground, Operating(slip=np.asarray(found["slip"]), load=80.0))
    np.testing.assert_allclose(found["torque"], own.torque, rtol=1e-5)
    np.testing.assert_allclose(found["pull"], own.drawbar_pull, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found["sinkage"], 1e3 * own.sinkage, rtol=1e-5)
    assert min(found["slip"]) == pytest.approx(0.0 if slip > 0 else -0.9)
    at = Operating(slip=slip, load=80.0)
    profile = model.profile(ground, at, 97)
    np.testing.assert_allclose(found["profile"]["normal"], 1e-3 * profile.normal, rtol=1e-5)
    np.testing.assert_allclose(
        found["profile"]["angle"], np.rad2deg(profile.angle), rtol=1e-5, atol=1e-9
    )
    assert found["at"]["torque"] == pytest.approx(float(model(ground, at).torque), rel=1e-5)


@pytest.mark.parametrize("wheel", GEARS)
def test_every_wheel_stands_on_every_soil_that_carries_it(wheel):
    values = {path: c["value"] for path, c in sliders({"wheel": wheel}).items()}
    found = forward({"wheel": wheel, "values": values})
    assert found["reason"] == "" and np.isfinite(found["torque"]).all()
    assert len(found["profile"]["angle"]) == 97


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"wheel": "square"}, "no wheel 'square'"),
        ({"wheel": {}}, "no wheel {}"),
        ({"soil": "wong1989/drysand"}, "did you mean 'wong1989/dry_sand'"),
        ({"soil": 3}, "needed is the name of a soil"),
        ({"values": {"cohesion": -1.0}}, "cohesion is -1 Pa"),
        ({"values": {"cohesion": "1"}}, "cohesion: needed is a number"),
        ({"values": {"cohesion": float("nan")}}, "cohesion: needed is a number"),
        ({"values": {"cohesive": 1.0}}, "no parameter 'cohesive'"),
        ({"values": [1]}, "needed are numbers by name"),
        ({"model": "[gear"}, "MODEL.toml"),
        ({"model": MODEL.replace("0.12", "-3")}, "MODEL.toml"),
    ],
    ids=str,
)
def test_a_wrong_request_is_answered_in_one_line(request_, said):
    with pytest.raises(InputError) as error:
        forward(request_)
    assert said in str(error.value) and "\n" not in str(error.value)
    assert "soilml-model-" not in str(error.value)
