"""A bake: its records, its arrays, and the ways to end it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import haarlight


def test_the_plan_tells_what_runs(cornell):
    plan = {effect["name"]: effect for effect in cornell.plan}
    assert plan["occlusion"]["runs"] and not plan["sky"]["runs"]
    assert all(set(effect) == {"name", "runs", "lacking", "reason"} for effect in cornell.plan)
    assert [light["kind"] for light in cornell.facts["lights"]] == ["surface"]
    assert "cornell.glb" in repr(cornell)


def test_rounds_are_flat_records(lit):
    assert lit.verdict == "reached"
    assert [record["round"] for record in lit.rounds] == list(range(1, len(lit.rounds) + 1))
    last = lit.rounds[-1]
    assert not any(isinstance(value, dict) for value in last.values())
    assert 0 < last["error.total_de2000"] <= 0.5 and last["error.total_de2000.kind"] == "estimate"
    assert last["error.convergence.kind"] == "bound"
    assert lit.rounds[0]["error.total_de2000"] is None
    assert 0 < lit.error <= 0.5


def test_arrays_fit_each_other_and_are_not_copies(lit, cornell):
    n, m = len(lit.positions), len(lit.triangles)
    assert lit.positions.shape == lit.normals.shape == lit.xyz.shape == lit.irradiance.shape == (n, 3)
    assert lit.triangles.shape == (m, 3) and lit.triangles.max() == n - 1
    assert lit.surface.shape == (n,) and lit.surface.max() < len(cornell.surfaces)
    kinds = [lit.positions.dtype, lit.normals.dtype, lit.xyz.dtype, lit.triangles.dtype]
    assert kinds == [np.float64, np.float32, np.float32, np.uint32]
    for array in (lit.positions, lit.xyz, lit.triangles, lit.surface, lit.spectra()):
        with pytest.raises(ValueError, match="read-only"):
            array.flat[0] = 0
    for name in ("positions", "normals", "xyz", "irradiance", "triangles", "surface"):
        assert getattr(lit, name) is getattr(lit, name)
    assert lit.spectra() is lit.spectra()
    low, high = np.array(cornell.facts["bounds_m"])
    assert (lit.positions >= low - 1e-6).all() and (lit.positions <= high + 1e-6).all()
    np.testing.assert_allclose(np.linalg.norm(lit.normals, axis=1), 1, atol=1e-5)


def test_spectra_sum_to_the_tristimulus_values(lit):
    edges = lit.edges
    middles = (edges[1:] + edges[:-1]) / 2
    np.testing.assert_array_equal(lit.spectra(middles), lit.spectra())
    np.testing.assert_array_equal(lit.spectra([edges[0], edges[-1]]), lit.spectra()[:, [0, -1]])
    # Luminous power of a spectrum by another table than the library's: a Gaussian of y bar, 2 % off at the most.
    y_bar = 1.019 * np.exp(-285.4 * (middles / 1000 - 0.559) ** 2)
    lux = 683 * (lit.spectra() @ y_bar) * (edges[1] - edges[0])
    bright = lit.xyz[:, 1] > 1
    assert bright.sum() > 1000
    np.testing.assert_allclose(lux[bright], lit.xyz[bright, 1], rtol=0.1)
    assert abs(lux[bright].mean() / lit.xyz[bright, 1].mean() - 1) < 0.03


def test_wavelengths_outside_are_named(lit):
    with pytest.raises(haarlight.InputError, match="900 nm lies outside of 380 to 780 nm"):
        lit.spectra([500, 900])
    with pytest.raises(haarlight.InputError, match=r"shape \(1, 2\)"):
        lit.spectra([[500, 600]])


def test_on_round_hears_every_round(cornell):
    heard = []
    light = cornell.bake(error=1, mesh=False, on_round=heard.append)
    assert heard == light.rounds


@pytest.mark.parametrize("no", [False, np.False_])
def test_on_round_stops_with_a_whole_solution(cornell, grid, no):
    light = cornell.bake(error=0.01, on_round=lambda record: no if record["round"] == 2 else None)
    assert (light.verdict, len(light.rounds)) == ("interrupted", 2)
    assert np.isfinite(light.xyz).all()
    exact = cornell.bake(error=0.5, mesh=False).probe(grid, [0, 1, 0])
    np.testing.assert_allclose(light.probe(grid, [0, 1, 0]).lux, exact.lux, rtol=0.1)


def test_an_exception_of_on_round_comes_out(cornell):
    with pytest.raises(ZeroDivisionError):
        cornell.bake(on_round=lambda record: 1 / 0)


def test_an_event_stops_a_bake(cornell):
    stop = threading.Event()
    stop.set()
    heard = []
    light = cornell.bake(error=0.01, mesh=False, stop=stop, on_round=lambda _: (heard.append(1), time.sleep(0.2)))
    assert light.verdict == "interrupted" and len(heard) <= 2


def test_time_bounds_a_bake(cornell):
    light = cornell.bake(error=0.01, time=0.5)
    assert light.verdict == "out_of_time" and np.isfinite(light.xyz).all()


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("presses", [1, 2])
def test_ctrl_c(scenes, presses):
    """The first Ctrl-C ends a bake with a whole result, the second raises KeyboardInterrupt at once."""
    program = textwrap.dedent(
        """
        import sys, haarlight
        room = haarlight.load(sys.argv[1])
        try:
            light = room.bake(error=1e-4, on_round=lambda r: print("round", flush=True))
        except KeyboardInterrupt:
            print("KeyboardInterrupt")
        else:
            print(light.verdict, bool((light.probe([[.4, .4, .1]], [0, 1, 0]).lux > 0).all()))
        """
    )
    run = [sys.executable, "-c", program, str(scenes / "cornell.glb")]
    child = subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    # The fifth round takes the better part of a second; the mesh then takes some seconds, in which the second press comes.
    assert [child.stdout.readline() for _ in range(4)] == ["round\n"] * 4
    for _ in range(presses):
        time.sleep(0.15)
        os.kill(child.pid, signal.SIGINT)
    out, said = child.communicate(timeout=300)
    last = out.splitlines()[-1]
    assert last == ("interrupted True" if presses == 1 else "KeyboardInterrupt"), said
    assert "ending with what is solved" in said


def test_python_runs_while_a_bake_works(cornell):
    ticks = []
    done = threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.01)

    clock = threading.Thread(target=tick)
    clock.start()
    cornell.bake(error=0.5)
    done.set()
    clock.join()
    assert len(ticks) > 10
    assert np.diff(ticks).max() < 0.5


def test_two_threads_bake_at_once(cornell, lit):
    lights = [None, None]

    def bake(k):
        lights[k] = cornell.bake(error=0.5)

    threads = [threading.Thread(target=bake, args=(k,)) for k in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for light in lights:
        np.testing.assert_array_equal(light.xyz, lit.xyz)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"error": 0}, "error: is not a number above zero"),
        ({"error": float("nan")}, "error: is not"),
        ({"time": -1}, "time: is not"),
        ({"rounds": 0}, "rounds: is 0"),
        ({"spectrum": "uniform:65"}, "spectrum: is 'uniform:65'; 65: 1 to 64 are possible"),
    ],
)
def test_wrong_wishes_are_named(cornell, arguments, what):
    with pytest.raises(haarlight.InputError, match=what):
        cornell.bake(**arguments)


def test_without_a_mesh_there_are_probes_and_no_arrays(cornell, grid):
    light = cornell.bake(error=1, mesh=False)
    assert (light.probe(grid, [0, 1, 0]).lux > 0).all()
    for ask in (lambda: light.positions, light.spectra, lambda: light.save("x.glb")):
        with pytest.raises(haarlight.InputError, match="bake with mesh=True"):
            ask()


def test_audits_measure_the_error(lit):
    audit = lit.audit(100)
    assert audit["points"] + audit["covered"] == 100
    assert audit["honesty"] == "honest"
    assert audit["de2000.mean.low"] <= audit["de2000.mean.value"] <= audit["de2000.mean.high"] < 1
