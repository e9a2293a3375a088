import pytest
from ridetune.engine.errors import SimulationError
from ridetune.engine.simulation.rims_settings import RimsSettings


@pytest.mark.parametrize(
    "wrong",
    [
        {"a_x_cutoff_hz": 0.0},
        {"rim_cutoff_hz": float("nan")},
        {"output_cutoff_hz": -1.0},
        {"output_highpass_hz": 0.001},
        {"output_highpass_hz": 10.0},
        {"initial_state": "running"},
        {"a_x_cutoff_hz": 1e-9},
        {"step": 0.0},
        {"step": 1e-9},
        {"step": 0.1},
    ],
)
def test_settings_that_mean_nothing_are_refused(wrong):
    [name] = wrong
    with pytest.raises(SimulationError, match=f"^{name} is"):
        RimsSettings(**wrong)


def test_a_band_that_leaves_nothing_to_compare_is_refused():
    with pytest.raises(SimulationError, match="leaves nothing to compare"):
        RimsSettings(output_highpass_hz=2.0, output_cutoff_hz=1.0)
