from types import SimpleNamespace

import numpy as np
from ridetune.engine.identification.fit_findings import hardly_moving, poor_fit

TIME = np.linspace(0.0, 20.0, 2001)
BODY = 0.01 * np.sin(7.0 * TIME) + 0.003 * np.cos(3.0 * TIME)


def test_a_channel_the_model_cannot_follow_is_named():
    other = 0.01 * np.sin(11.0 * TIME)
    assert "chassis.z of run lap poorly" in poor_fit("lap", "chassis.z", BODY, other, 5e-4)


def test_a_channel_buried_in_its_stated_noise_is_not_blamed():
    rng = np.random.default_rng(0)
    measured = BODY + 0.02 * rng.normal(size=len(TIME))
    assert poor_fit("lap", "chassis.z", measured, BODY, 0.02) is None
    assert poor_fit("lap", "chassis.z", measured, BODY, 5e-4) is not None


def test_a_run_that_moves_little_more_than_its_noise_is_told_of():
    """Oracle: the ratio of the motion's deviation to that of the noise."""
    run = SimpleNamespace(name="lap", measured={"chassis.z": BODY})
    for ratio, told in ((1.5, 1), (3.0, 0)):
        run.noise = {"chassis.z": np.std(BODY) / ratio}
        assert len(hardly_moving([run])) == told
