"""Looks under other lights and the metamerism index, against the same worked out with colour-science."""

import colour
import numpy as np
import pytest

from dyehouse.core import metamerism, spectra
from dyehouse.core.errors import TargetError
from dyehouse.core.spectra import Spectrum
from dyehouse.core.swatches import Swatch, parse_target

RED, TEAL = (Swatch.from_spectrum(spectra.chart("BabelColor Average")[name], name) for name in ("red", "cyan"))
OBSERVERS = {
    "1931": colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"],
    "1964": colour.MSDS_CMFS["CIE 1964 10 Degree Standard Observer"],
}


def theirs(spectrum, light, observer="1931"):
    cmfs, illuminant = OBSERVERS[observer], colour.SDS_ILLUMINANTS[light]
    white = colour.sd_to_XYZ(colour.sd_ones(), cmfs, illuminant, method="Integration") / 100
    if spectrum is None:
        return white
    sd = colour.SpectralDistribution(spectrum.values, spectrum.wavelengths)
    return colour.sd_to_XYZ(sd, cmfs, illuminant, method="Integration") / 100


def their_lab(xyz, white):
    return colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white))


@pytest.mark.parametrize("observer", ["1931", "1964"])
@pytest.mark.parametrize("swatch", [RED, TEAL], ids=str)
def test_looks(swatch, observer):
    looks = metamerism.under_lights(swatch, ("D65", "A", "FL11"), observer=observer)
    assert [look.light for look in looks] == ["D65", "A", "FL11"]
    d65 = np.array([0.3127, 0.3290])
    adapted = []
    for look in looks:
        xyz, white = theirs(swatch.color, look.light, observer), theirs(None, look.light, observer)
        np.testing.assert_allclose(look.lab, their_lab(xyz, white), atol=1e-4)
        seen = colour.adaptation.chromatic_adaptation_VonKries(xyz, white, colour.xy_to_XYZ(d65), transform="CAT16")
        adapted.append(colour.XYZ_to_Lab(seen, d65))
        np.testing.assert_allclose(look.shift, colour.delta_E(adapted[0], adapted[-1], method="CIE 2000"), atol=1e-4)
        codes = colour.XYZ_to_sRGB(seen)
        if swatch is RED:  # the cyan is outside sRGB under some
            np.testing.assert_allclose(look.display, codes, atol=2e-3)
        assert 0 <= look.display.min() <= look.display.max() <= 1
    assert looks[0].shift == 0


def rival_of(spectrum, observer="1931"):
    """Another reflectance with the same XYZ under D65: a smooth curve plus what D65 does not see of it."""
    nm = spectrum.wavelengths
    sensors = [spectra.to_xyz("D65", Spectrum(nm, row), observer) for row in np.eye(len(nm))]
    sensors = np.array(sensors)
    bump = 0.1 * np.sin(nm / 25)
    unseen = bump - sensors @ np.linalg.lstsq(sensors, bump, rcond=None)[0]
    unseen -= sensors @ np.linalg.solve(sensors.T @ sensors, sensors.T @ unseen)
    return Swatch.from_spectrum(Spectrum(nm, spectrum.values + unseen), "rival")


@pytest.mark.parametrize("observer", ["1931", "1964"])
@pytest.mark.parametrize("test", ["A", "FL11", "LED-B3"])
def test_index_of_a_metamer(test, observer):
    rival = rival_of(TEAL.color, observer)
    found = metamerism.special_index(TEAL, rival, test, observer=observer)
    assert found.reference_difference == pytest.approx(0, abs=1e-6)
    white = theirs(None, test, observer)
    labs = [their_lab(theirs(s.color, test, observer), white) for s in (TEAL, rival)]
    assert found.value == pytest.approx(colour.delta_E(*labs, method="CIE 1976"), abs=1e-4)
    assert found.value > 0.5
    assert "which is corrected for" in found.sentence


def test_correction_is_that_of_cie_15():
    # By hand with colour-science: XYZ of the sample under A times the ratio of the pair under D65.
    other = Swatch.from_spectrum(spectra.chart("ISO 17321-1")["red"], "other")
    one_r, other_r, one_t, other_t = (theirs(s.color, light) for light in ("D65", "A") for s in (RED, other))
    expected = colour.delta_E(
        their_lab(one_t, theirs(None, "A")), their_lab(other_t * one_r / other_r, theirs(None, "A")), method="CIE 1976"
    )
    found = metamerism.special_index(RED, other)
    assert found.value == pytest.approx(expected, abs=1e-4)
    assert found.reference_difference > 1


def test_a_pair_that_differs_in_strength_alone_is_no_metamer():
    # All of its difference is there under the reference light already, and is taken out.
    darker = Swatch.from_spectrum(Spectrum(RED.color.wavelengths, 0.8 * RED.color.values), "darker")
    found = metamerism.special_index(RED, darker)
    assert found.value == pytest.approx(0, abs=1e-9)
    assert found.reference_difference > 3
    assert metamerism.special_index(RED, RED).value == 0
    assert "no match" in metamerism.special_index(RED, TEAL).sentence


@pytest.mark.parametrize("text", ["#C0392B", "lab(42, 55, 35)", "rgb(0.5, 0.1, 0.1)"])
def test_of_three_numbers_it_cannot_be_known(text):
    swatch = parse_target(text)
    sentence = metamerism.cannot_be_known(swatch)
    assert "cannot be known" in sentence
    with pytest.raises(TargetError, match="cannot be known"):
        metamerism.under_lights(swatch)
    with pytest.raises(TargetError, match="cannot be known"):
        metamerism.special_index(RED, swatch)
    assert metamerism.cannot_be_known(RED) is None


def test_black_has_no_ratio():
    black = Swatch.from_spectrum(Spectrum(np.array([380.0, 730.0]), np.zeros(2)), "black")
    with pytest.raises(TargetError, match="reflects nothing"):
        metamerism.special_index(RED, black)
