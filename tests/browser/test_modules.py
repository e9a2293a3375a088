"""The page's own arithmetic, run in the browser on the engine's histories."""

import numpy as np
import pytest

from .conftest import visits

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def visitor(browser, service):
    """On a page that all have in common: its functions keep nothing."""
    with visits(browser) as visit:
        yield visit().open(service.address)


def in_module(visitor, name, body, *arguments):
    """Value of a function body with the module's exports as `m` and the arguments as `a`."""
    return visitor.page.evaluate(
        f"async (a) => {{ const m = await import('/static/{name}.js');"
        f" const ridetune = window.ridetune; {body} }}",
        list(arguments),
    )


@pytest.fixture
def driver(visitor):
    """On Manoeuvre 2's road."""
    visitor.page.select_option("#ride", "manoeuvre 2")
    visitor.until("ridetune.state('now') && ridetune.state('now').head.mode === 'road'")
    return visitor


def test_arms_keep_their_length_while_the_car_moves(driver):
    """Oracle: a rigid arm. Chassis pose, arm angle and wheel height come from three channels.

    float32 histories and their linear interpolation allow some 10 um.
    """
    lengths = in_module(
        driver,
        "ride/poses",
        """const at = (all, name) => all.find((x) => x.name === name && x.position).position;
        return a[0].map((t) => {
            const all = m.carMessages(ridetune.state("vehicle"), ridetune.state("now"), t, 1);
            return ["fl", "fr", "rl", "rr"].map((c) => {
                const [p, q] = [at(all, `/car/wheel_${c}`), at(all, `/car/pivot_${c}`)];
                return Math.hypot(p[0] - q[0], p[2] - q[2]);
            });
        });""",
        [0.0, 5.5, 10.3, 12.0, 14.7, 19.0],
    )
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], (6, 4)), atol=2e-5)


@pytest.mark.parametrize(
    ("distance", "angle", "length"),
    [
        (1.8, 0.06, None),
        # From a hub 0.3 m up to 0.05 m above ground: a share 0.25 / (0.3 + 3.2 tan 0.3) of the way.
        (3.2, -0.3, 0.25 / (0.3 + 3.2 * np.tan(0.3))),
        # Level with the hub, back to a third of a wheelbase of 2.6 m behind the rear axle.
        (8.0, np.arctan(0.3 / 8.0), 2.6 * (1 + 0.33) / 8.0),
    ],
)
def test_an_arm_is_drawn_as_far_as_the_car(visitor, distance, angle, length):
    """Oracle: where the straight arm leaves the body's box; None: it does not."""
    drawn, marked, told = in_module(
        visitor,
        "ride/poses",
        """const v = structuredClone(ridetune.state("vehicle"));
        v.front.wheel.radius = 0.3;
        v.rear.cg_distance = 2.6 - v.front.cg_distance;
        Object.assign(v.front.pivot, { distance: a[0], angle: a[1] });
        const rest = { time: [0], values: {} };
        const all = m.carMessages(v, rest, 0, 1);
        const scale = (name) => all.find((x) => x.name === name && x.updates).updates.scale[0];
        const pivot = all.find((x) => x.name === "/car/pivot_fl" && "visible" in x);
        return [scale("/car/arm_fl") / scale("/car/ray_fl"), pivot.visible,
            m.farPivots(v).some(({ axle }) => axle === "front")];""",
        distance,
        angle,
    )
    assert drawn == pytest.approx(1.0 if length is None else length)
    assert marked == (length is None)
    assert told == (length is not None)


def test_wheels_touch_the_magnified_road(driver):
    """The tyre gives by load over stiffness: a few mm at most around its static compression."""
    gaps = in_module(
        driver,
        "ride/poses",
        """const run = ridetune.state("now");
        return [8, 11, 16].map((t) => {
            const where = m.locate(run.time, t);
            const all = m.carMessages(ridetune.state("vehicle"), run, t, 20);
            return ["fl", "fr", "rl", "rr"].map((c) => {
                const wheel = all.find((x) => x.name === `/car/wheel_${c}` && x.position);
                const { front, rear } = ridetune.state("vehicle");
                const { radius } = (c[0] === "f" ? front : rear).wheel;
                return wheel.position[2] - radius - 20 * m.valueAt(run, `road.${c}.z`, where);
            });
        });""",
    )
    assert np.abs(gaps).max() < 20 * 0.02


def test_the_road_surface_has_the_height_under_the_wheels(driver):
    """Straight lines between stations 0.15 m apart miss a class C road by 0.45 mm rms.

    That is the integral of Gd(n) (1 - cos(pi n 0.15 m))^2 over the band; five times that is never
    met, the other track's height would be off by 10 mm.
    """
    differences = in_module(
        driver,
        "ride/road",
        """const run = ridetune.state("now"), vehicle = ridetune.state("vehicle");
        const { vertices } = m.surface(vehicle, run);
        const columns = 6, out = [];
        for (let i = 0; i < run.time.length; i += 40) {
            const x = run.values["chassis.x"][i] + vehicle.front.cg_distance;
            for (const [corner, column] of [["fl", 0], ["fr", 5]]) {
                let k = column;
                while (vertices[3 * (k + columns)] < x) k += columns;
                const [x0, z0] = [vertices[3 * k], vertices[3 * k + 2]];
                const [x1, z1] = [vertices[3 * (k + columns)], vertices[3 * (k + columns) + 2]];
                out.push(z0 + (z1 - z0) * (x - x0) / (x1 - x0) - run.values[`road.${corner}.z`][i]);
            }
        }
        return out;""",
    )
    assert len(differences) > 80
    assert np.abs(differences).max() < 5 * 0.45e-3


def test_a_dragged_pivot_is_where_the_sliders_say(visitor):
    """distance and angle from a point in B, and back by the model's definition."""
    found = in_module(
        visitor,
        "ride/poses",
        """const v = ridetune.state("vehicle"), h = v.chassis.cg_height;
        return [
            m.pivotAt(v, "front", [v.front.cg_distance - 1.7, 0, 1.7 * Math.tan(0.11) - h]),
            m.pivotAt(v, "rear", [1.2 - v.rear.cg_distance, 0, 1.2 * Math.tan(0.3) - h]),
        ].flatMap(({ distance, angle }) => [distance, angle]);""",
    )
    assert found == pytest.approx([1.7, 0.11, 1.2, 0.3])


def test_the_spectrum_holds_the_power_of_the_signal(visitor):
    """Oracle: a sine of amplitude 3 has power 4.5, wherever it lies; white noise its variance."""
    area, peak, noise, variance = in_module(
        visitor,
        "ride/spectrum",
        """const n = 2001, step = 0.01;
        const time = Float64Array.from({ length: n }, (_, i) => i * step);
        const sum = (s) => s.density.reduce((a, b) => a + b, 0) * s.frequency[0];
        const sine = m.density(time, time.map((t) => 3 * Math.sin(2 * Math.PI * 4 * t) + 7));
        const top = sine.frequency[sine.density.indexOf(Math.max(...sine.density))];
        let seed = 1;
        const noise = time.map(() => (seed = (seed * 16807) % 2147483647) / 2147483647 - 0.5);
        return [sum(sine), top, sum(m.density(time, noise)), 1 / 12];""",
    )
    assert area == pytest.approx(4.5, rel=0.02)
    assert peak == pytest.approx(4.0, abs=0.11)
    assert noise == pytest.approx(variance, rel=0.15)


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (
            "front.suspension.stiffness is at its upper bound, 1.76e+05 N/m; widen the bound.",
            "KF front spring stiffness is at its upper bound, 176.0 N/mm; widen the bound.",
        ),
        (
            "The bounds of rear.pivot.angle, 1.3 to -0.3 rad, are crossed.",
            "The bounds of φR rear pivot angle, 74.48 to −17.19 deg, are crossed.",
        ),
        (
            "front.suspension.stiffness is 1e+08 N/m, but must lie between 100 and 1e+07 N/m.",
            "KF front spring stiffness is 100000 N/mm, but must lie between 0.1000 and 10000 N/mm.",
        ),
        (
            "car.json: rear.pivot.angle is 90, but must lie between -1.5 and 1.5 rad.",
            "car.json: φR rear pivot angle is 5157 deg, but must lie between −85.94 and 85.94 deg.",
        ),
        (
            "rear.stabilizer_bar.damping starts at 1800 N m s/rad, rear.stabilizer_bar.stiffness "
            "at 18000 N m/rad.",
            "CtorR rear stabilizer bar damping starts at 31.42 N m s/deg, KtorR rear stabilizer "
            "bar stiffness at 314.2 N m/deg.",
        ),
        # What is no slider is shown in SI on the page, too; channels keep their column's name.
        ("front.tyre.stiffness is 5 N/m.", "front tyre stiffness is 5 N/m."),
        ("chassis.z of run a.csv moves 3 times as much.",) * 2,
    ],
)
def test_sentences_of_the_service_are_said_in_the_pages_words(visitor, said, shown):
    """Oracle: unit conversion by hand; 1 rad is 57.296 deg."""
    text = in_module(
        visitor,
        "common/wording",
        """return m.worded(a[0]).map((part) => part.textContent ?? part).join("");""",
        said,
    )
    assert text == shown


@pytest.mark.parametrize(
    ("low", "high", "lines"),
    [
        (2e-3, 0.5, [1e-3, 1e-2, 1e-1, 1]),
        (1e-12, 1, [10.0**k for k in (-12, -9, -6, -3, 0)]),
    ],
)
def test_a_logarithmic_axis_has_few_lines_at_powers_of_ten(visitor, low, high, lines):
    found = in_module(visitor, "common/plots", "return m.decades(a[0], a[1]);", low, high)
    assert found == pytest.approx(lines)


@pytest.mark.parametrize(
    ("interval", "shown"),
    [
        ([13.96, None], "from 13.96"),
        ([None, 13.96], "up to 13.96"),
        ([2.1, 3.4], "2.10 … 3.40"),
        ([None, None], "unbounded"),
    ],
)
def test_an_end_that_stands_alone_is_not_rounded_beyond_its_value(visitor, interval, shown):
    """A value of 13.96 at its bound is not "from 14.0"."""
    assert in_module(visitor, "common/intervals", "return m.span(a[0], 1);", interval) == shown


BAR, RATIO = "rear.stabilizer_bar.stiffness", "front.suspension.rebound_ratio"
BY_A_BOUND = "rear stabilizer bar stiffness is where its bound puts it"


@pytest.mark.parametrize(
    ("held", "said"),
    [
        ({}, ""),
        (None, ""),
        ({BAR: ["d"]}, f"if {BY_A_BOUND}"),
        ({RATIO: ["d"]}, "if the dampers are linear"),
        ({BAR: ["d"], RATIO: ["d", "e"]}, f"if {BY_A_BOUND} and the dampers are linear"),
    ],
)
def test_what_a_bound_decides_is_not_marked_as_what_runs_determine(visitor, held, said):
    """A fit of an earlier version tells no conditions."""
    body = """const marked = [["d", "yes"], ["K", "yes"], ["C", "no"]].map(([name, determined]) =>
            m.mark({ name, determined }, { verdict: a[0], parameters: [{ name: a[1] }] }));
        return marked.map(({ innerText, className, title }) => [innerText, className, title]);"""
    well, other, not_at_all = in_module(
        visitor, "common/determined", body, {"conditions": held}, BAR
    )
    assert other == ["well", "determined yes", "well determined"]
    assert not_at_all == ["not", "determined no", "not determined"]
    if held:
        assert well[:2] == ["well, if …", "determined yes conditional"]
        assert well[2] == f"well determined, {said}"
    else:
        assert well == ["well", "determined yes", "well determined"]


def test_a_view_that_fails_is_reported_and_nobody_else_s_affair(visitor):
    """Whoever changes the state, and the other views, go on; the page's errors tell of it."""
    visitor.expect("the view's own mistake")
    seen = in_module(
        visitor,
        "common/store",
        """const seen = [];
        m.on("ofTheTest", () => { throw new Error("the view's own mistake"); });
        m.on("ofTheTest", () => seen.push(m.get("ofTheTest")));
        m.set({ ofTheTest: 1 });
        return seen;""",
    )
    assert seen == [1]
    visitor.wait(visitor.complaints.__len__, "the page's error")
