"""How far each effect is from its closed form, its quadrature or an independent peer: runs the tests and prints a table.

    python3 tools/effects/closed_forms.py

The tests print what they compare as `... GOT for WANT ...`; the worst relative difference and the root mean square of each test's lines
are what stands in the table. Lines that begin with `CIE 171` are printed as they are, cases by cases.
"""

import math
import re
import subprocess
import sys

# Effect, test file, test, what it is beside.
ROWS = [
    ("sky", "sky", "an_even_sky_gives_open_ground_pi_l", "E = pi L on open ground"),
    ("sky", "sky", "cie_171_case_5_9_closed_form", "rectangle seen from a perpendicular element (4 x 4 roof, printed digits)"),
    ("sky", "reference", "the_solver_agrees_under_a_sky", "dense reference, one wavelength"),
    ("sky, hosek", "spectral_sky", "open_ground_has_the_light_of_the_model", "quadrature of the model, X, Y and Z"),
    ("sky, hosek", "spectral_sky", "light_through_openings_has_the_colour_of_the_model", "quadrature through openings, X, Y and Z"),
    ("sky, map", "sky_maps", "a_map_of_a_sky_gives_the_light_of_that_sky", "the sky that the map shows"),
    ("sun", "sky", "the_sun_lights_a_patch_of_the_floor", "E sin(elevation)"),
    ("sun", "sky", "the_edge_of_a_sun_patch_is_as_wide_as_its_disc", "disc beyond a chord (of the open sun)"),
    ("pane", "panes", "lamps_shine_through_slabs", "Fresnel slab between a point light and points"),
    ("pane", "panes", "three_panes_in_a_row_multiply", "product of three slabs"),
    ("pane", "panes", "solids_absorb_along_the_chord", "Beer's law along chords"),
    ("pane", "reference", "the_solver_agrees_behind_a_pane", "dense reference, one wavelength"),
    ("pane", "panes", "the_path_tracer_agrees", "path tracer (its noise included)"),
    ("sheet", "sheets", "two_slabs_exchange_light_through_a_sheet", "three plates without end, very near"),
    ("sheet", "sheets", "a_ball_of_paper_around_a_lamp", "two cavities that exchange light through a ball"),
    ("sheet", "reference", "the_solver_agrees_behind_a_sheet", "dense reference, one wavelength"),
    ("profile", "lamps", "a_profile_lights_the_floor_by_its_closed_form", "E = I cos^3 / h^2"),
    ("profile", "lamps", "a_panel_shines_from_its_area", "quadrature over the panel"),
    ("profile", "lamps", "a_panel_is_right_close_by", "Lambertian rectangle, 2 mm to 10 cm away"),
    ("mirror", "mirrors", "a_lamp_beside_a_mirror_shines_twice", "the lamp and its image"),
    ("mirror", "mirrors", "panels_and_the_sun_shine_twice", "panel, sun and their images"),
    ("mirror", "mirrors", "a_periscope_shows_a_lamp", "the lamp through two mirrors"),
    ("mirror", "mirrors", "the_sky_is_seen_in_mirrors", "sky and its image"),
    ("mirror", "mirrors", "a_periscope_shows_the_sky", "an opening through two mirrors"),
    ("mirror", "mirrors", "a_lamp_in_a_tinted_mirror_is_tinted", "Fresnel's share, band by band"),
    ("mirror", "mirrors", "the_path_tracer_agrees", "path tracer (its noise included)"),
    ("dye", "fluorescence", "a_furnace_has_the_gain_of_its_walls", "E = (L + e q) / (1 - rho)"),
    ("dye", "fluorescence", "white_paper_agrees_with_the_whole_matrix", "dense reference with the 64 x 64 matrix"),
]
# Tests that print cases of CIE 171, by file; all of a file that has none of ROWS.
OF_CIE_171 = {"sky": ["cie_171_case_5_9", "rays_through_an_opening", "ground_below_the_horizon"], "panes": ["case_5_10_glazed_openings"]}
NUMBER = r"-?[0-9.]+(?:e-?[0-9]+)?"
# A number, or some in brackets.
VALUE = rf"({NUMBER}|\[[^\]]*\])"
COMPARED = re.compile(VALUE + " for " + VALUE)


def differences(text):
    """Relative differences of what a test printed, by test; lines of CIE 171 as they are."""
    found, cases, current = {}, [], None
    for line in text.splitlines():
        if begins := re.match(r"test (\S+) \.\.\.", line):
            current = begins[1]
        if "CIE 171 |" in line:
            cases.append("|" + line.split("CIE 171 |")[1])
        for pair in COMPARED.findall(line):
            for got, want in zip(*([float(x) for x in re.findall(NUMBER, value)] for value in pair)):
                if want != 0:
                    found.setdefault(current, []).append(got / want - 1)
    return found, cases


def main():
    files = list(dict.fromkeys(row[1] for row in ROWS)) + ["facades"]
    asked = {name: [row[2] for row in ROWS if row[1] == name] + OF_CIE_171.get(name, []) for name in files}
    found, cases = {}, []
    for name in files:
        command = ["cargo", "test", "--release", "--test", name, "--", "--nocapture", "--test-threads", "1"]
        command += asked[name]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode:
            sys.stdout.write(done.stdout)
            raise SystemExit(f"{name} fails")
        off, rows = differences(done.stdout)
        found[name] = off
        cases += rows
    print("| case | what | worst point, % | rms, % |\n|---|---|---:|---:|")
    print("\n".join(cases))
    print("\n| effect | beside | figures | worst, % | rms, % |\n|---|---|---:|---:|---:|")
    for effect, name, test, beside in ROWS:
        off = found[name][test]
        worst, rms = max(map(abs, off)), math.sqrt(sum(x * x for x in off) / len(off))
        print(f"| {effect} | {beside} (`{test}`) | {len(off)} | {100 * worst:.2g} | {100 * rms:.2g} |")


if __name__ == "__main__":
    main()
