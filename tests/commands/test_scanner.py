"""`wheelplane scanner`: a file that `measure --scanner` takes, from field tests."""

import pytest
from click.testing import CliRunner

from tests.uncertainty.test_field_tests import lengths, two_faces
from wheelplane.cli import cli
from wheelplane.config import Config, EnvironmentConfig, parse_section, with_scanner
from wheelplane.errors import ConfigError, InputError


def test_a_file_by_field_tests_is_taken_by_measure(tmp_path):
    tests = [two_faces(tmp_path / "faces.csv"), lengths(tmp_path / "lengths.csv")]
    file = tmp_path / "mine.toml"
    options = [text for path in tests for text in ("--from", str(path))]
    result = CliRunner().invoke(cli, ["scanner", *options, "-o", str(file)])
    assert result.exit_code == 0, result.output
    assert "trunnion_arcsec" in result.output
    instrument = with_scanner(Config(), str(file)).instrument
    assert 30.0 < instrument.trunnion_arcsec < 40.0
    assert 7e-4 < instrument.range_bias_m < 9e-4
    again = tmp_path / "again.toml"
    CliRunner().invoke(cli, ["scanner", *options, "-o", str(again)])
    assert again.read_bytes() == file.read_bytes()


def test_terms_that_the_tests_do_not_show_are_named(tmp_path):
    file = tmp_path / "mine.toml"
    test = lengths(tmp_path / "lengths.csv", between=False)
    result = CliRunner().invoke(cli, ["scanner", "--from", str(test), "-o", str(file)])
    assert "Not shown by these tests: range_bias_m." in result.output
    assert "# range_bias_m: these tests do not show it" in file.read_text()
    assert with_scanner(Config(), str(file)).instrument.range_bias_m == 0.0


def test_a_field_test_is_not_replaced_by_what_it_shows(tmp_path):
    test = lengths(tmp_path / "lengths.csv")
    before = test.read_bytes()
    again = tmp_path / "again.toml"
    again.symlink_to(test)
    for output in (test, again):
        result = CliRunner().invoke(cli, ["scanner", "--from", str(test), "-o", str(output)])
        assert isinstance(result.exception, InputError)
        assert f"{output}: this command reads it" in str(result.exception)
        assert test.read_bytes() == before


def test_a_file_that_is_missing_is_one_line(tmp_path):
    missing = tmp_path / "none.csv"
    result = CliRunner().invoke(cli, ["scanner", "--from", str(missing), "-o", "x.toml"])
    assert result.exit_code == 1
    assert "cannot be read" in str(result.exception)


@pytest.mark.parametrize(
    ("key", "right", "slip"),
    [
        ("range_sigma_m", 0.0008, 0.8),
        ("spot_radius_m", 0.0015, 1.5),
        ("range_bias_m", 0.0005, 0.5),
        ("range_scale_ppm", 60.0, 60000.0),
        ("incidence_bias_m", 0.0003, 0.3),
        ("collimation_arcsec", 36.0, 36000.0),
        ("trunnion_arcsec", 36.0, 36000.0),
        ("vertical_index_arcsec", 36.0, 36000.0),
        ("azimuth_eccentricity_arcsec", 36.0, 36000.0),
        ("elevation_eccentricity_arcsec", 36.0, 36000.0),
        ("beam_offset_m", 0.0003, 0.3),
        ("pointing_urad", 100.0, 1e5),
        ("registration_m", 0.0005, 0.5),
        ("distance_m", 3.0, 3000.0),
    ],
)
def test_a_slip_of_a_thousand_in_a_scanner_file_is_refused(tmp_path, key, right, slip):
    file = tmp_path / "mine.toml"
    form = '[instrument]\nkind = "laser-scanner"\n{} = {}\n'
    file.write_text(form.format(key, right))
    assert getattr(with_scanner(Config(), str(file)).instrument, key) == right
    file.write_text(form.format(key, slip))
    with pytest.raises(ConfigError, match=rf"mine\.toml: \[instrument\]: {key}: .* got {slip}"):
        with_scanner(Config(), str(file))


@pytest.mark.parametrize(
    ("key", "right", "slips"),
    [
        ("temperature_c", [-5.0, 40.0], ([294.0, 295.0], [20.0, 295.0])),
        ("humidity_percent", [0.0, 100.0], ([48.0, 530.0], [-1.0, 50.0])),
        ("pressure_hpa", [870.0, 1085.0], ([101.3, 101.4], [101300.0, 101400.0])),
        ("temperature_u_c", 0.3, (273.4,)),
        ("humidity_u_percent", 2.5, (250.0,)),
        ("pressure_u_hpa", 0.5, (500.0,)),
    ],
)
def test_conditions_in_other_units_are_refused(key, right, slips):
    parse_section(EnvironmentConfig, {key: right}, "here")
    for slip in slips:
        with pytest.raises(ConfigError, match=f"here: {key}.* got"):
            parse_section(EnvironmentConfig, {key: slip}, "here")
