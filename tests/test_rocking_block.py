"""A rocking block, against Housner's and Hogan's closed forms for a slender block."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import continuation
import jaxcam
from jaxcam.models import RockingBlock


GRAVITY = 9.81
# so slender that sin(alpha - q) is alpha - q to a relative error of 1e-8
SLENDER = 1e-4
RATE = np.sqrt(3 * GRAVITY / 4)


def slender(**numbers) -> RockingBlock:
    return RockingBlock(half_width=SLENDER, half_height=1.0, **numbers)


def test_impacts_of_a_stout_block_by_another_integrator():
    """The equation of rocking by DOP853: a dozen impacts to 1e-8 s."""
    factor = RockingBlock().housner_restitution
    assert float(factor) == pytest.approx(1 - 1.5 / 17)
    block = RockingBlock(restitution=factor)
    run = jaxcam.simulate(block, block.rocking(0.12), 0.0, 4.0)
    assert run.successful
    radius, alpha = np.hypot(0.1, 0.4), np.arctan2(0.1, 0.4)

    def field(t, x, side):
        return [x[1], -side * GRAVITY * np.sin(alpha - side * x[0]) * 0.75 / radius]

    def impact(t, x, side):
        return x[0]

    impact.terminal = True  # pyright: ignore
    t, x, side, times = 0.0, [0.12, 0.0], 1.0, []
    for _ in range(12):
        impact.direction = -side  # pyright: ignore
        flight = solve_ivp(
            field,
            (0, 10),
            x,
            method="DOP853",
            events=impact,
            rtol=1e-12,
            atol=1e-14,
            args=(side,),
        )
        t, x = t + flight.t[-1], [0.0, float(factor) * flight.y[1, -1]]
        times, side = [*times, t], -side
    assert np.max(np.abs(run.impacts.time[:12] - np.array(times))) < 1e-8


def test_a_block_that_ceases_to_rock():
    """Half periods 2 artanh(r^n u); they end in rest after their sum, to 3e-6 s."""
    start, r = 0.4, 0.8
    block = slender(restitution=r)
    run = jaxcam.simulate(block, block.rocking(start * SLENDER), 0.0, 5.0)
    assert run.successful
    first = np.arccosh(1 / (1 - start))
    speed = np.sqrt(1 - (1 - start) ** 2) * r ** np.arange(1, 200)
    exact = first + np.append(0.0, np.cumsum(2 * np.arctanh(speed)))
    exact = exact / RATE
    assert np.max(np.abs(run.impacts.time[:20] - exact[:20])) < 1e-7
    contacts = run.contacts
    stands = np.asarray(contacts.start)[~np.asarray(contacts.released)]
    assert stands == pytest.approx([exact[-1]] * 2, abs=3e-6)


def test_a_standing_block_waits_for_the_floor():
    """It begins to rock where the floor's acceleration is g tan(alpha), to 1e-9 s."""
    block = RockingBlock(amplitude=3.0, omega=6.0)
    start = np.pi / 2 / 6.0
    run = jaxcam.simulate(block, block.rocking(0.0), start, start + 0.3)
    assert run.successful
    # the floor accelerates to the left: the left corner rises
    end = float(run.contacts.end[np.asarray(run.contacts.constraint) == 0][0])
    assert end == pytest.approx(np.arccos(-GRAVITY / 4 / 3.0) / 6.0, abs=1e-9)
    assert float(run.final[0]) > 0
    still = RockingBlock(amplitude=2.4, omega=6.0)
    run = jaxcam.simulate(still, still.rocking(0.0), start, start + 9.0)
    assert run.successful
    assert float(np.max(np.abs(np.asarray(run.final)))) < 1e-12


def hogan(omega: float, forcing: float, r: float) -> tuple[float, float]:
    """Phase and rate after the impact of the symmetric orbit, in units of alpha.

    On one corner, x = 1 + A e^(p t) + B e^(-p t) + F cos(omega t + phase), which
    vanishes at both ends of half a period with rates v and -v / r.
    """
    size = forcing * RATE**2 / (omega**2 + RATE**2)

    def value(t, a, b, phase):
        grows, decays = a * np.exp(RATE * t), b * np.exp(-RATE * t)
        return 1 + grows + decays + size * np.cos(omega * t + phase)

    def slope(t, a, b, phase):
        grows, decays = a * np.exp(RATE * t), b * np.exp(-RATE * t)
        swing = size * omega * np.sin(omega * t + phase)
        return RATE * (grows - decays) - swing

    def conditions(u):
        half = np.pi / omega
        both = slope(0.0, *u) + r * slope(half, *u)
        return [value(0.0, *u), value(half, *u), both]

    found = fsolve(conditions, [-0.1, -0.1, 4.6], xtol=1e-12)
    inside = np.linspace(0.0, np.pi / omega, 200)[1:-1]
    assert np.all(value(inside, *found) > 0)
    return found[2], slope(0.0, *found)


@pytest.mark.parametrize(("omega", "forcing"), [(8.0, 3.0), (12.0, 5.0), (15.0, 8.0)])
def test_the_symmetric_orbit_of_hogan(omega, forcing):
    """Impacts to 1e-8 s, and multipliers: their product is r^4, their modulus r^2."""
    r = 0.925
    phase, rate = hogan(omega, forcing, r)
    amplitude = forcing * GRAVITY * SLENDER
    block = slender(restitution=r, amplitude=amplitude, omega=omega)
    period, start = 2 * np.pi / omega, phase / omega
    state = block.rocking(0.0, rate * SLENDER)
    run = jaxcam.simulate(block, state, start, period)
    orbit = continuation.periodic_orbit(block, run.final, periods=1)
    again = jaxcam.simulate(block, run.final, 0.0, 40 * period)
    last = np.asarray(again.impacts.time)[-2:]
    miss = (last - start + period / 4) % (period / 2) - period / 4
    assert np.max(np.abs(miss)) < 1e-8
    sizes = np.sort(np.abs(np.asarray(orbit.multipliers)))
    assert sizes[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert sizes[2:] == pytest.approx([r**2, r**2], abs=1e-6)


def test_what_a_block_may_not_be():
    with pytest.raises(ValueError, match="below 1"):
        RockingBlock(restitution=1.0).check()
    with pytest.raises(ValueError, match="positive number for `half_width`"):
        RockingBlock(half_width=0.0).check()
