"""`wheelplane scanner`: a file that `measure --scanner` takes, from field tests."""

from click.testing import CliRunner

from tests.uncertainty.test_field_tests import lengths, two_faces
from wheelplane.cli import cli
from wheelplane.config import Config, with_scanner


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


def test_a_file_that_is_missing_is_one_line(tmp_path):
    missing = tmp_path / "none.csv"
    result = CliRunner().invoke(cli, ["scanner", "--from", str(missing), "-o", "x.toml"])
    assert result.exit_code == 1
    assert "cannot be read" in str(result.exception)
