"""Figures of stability and of maps show what they are given."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest

import variational
from jaxcam import plotting


pytestmark = pytest.mark.filterwarnings("error")


def test_multipliers_in_and_out_of_the_picture():
    figure = plotting.multipliers([[0.2 + 0.7j, 0.2 - 0.7j], [-50.0, 0.1]], reach=2.0)
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    assert len(lines["stable"].get_xdata()) == 3
    # one that does not fit is marked at the edge, on its own side
    edge = np.asarray(lines["outside the figure"].get_xdata())
    assert len(edge) == 1 and -2.0 <= edge[0] < -1.9
    assert figure.axes[0].get_xlabel() == r"real part of $\mu$ (–)"
    plt.close(figure)


def test_exponents_settle_in_a_band():
    running = np.array([[0.3, -0.5], [0.1, -0.4], [0.2, -0.45]])
    spectrum = SimpleNamespace(
        running=running, turn=2.0, exponents=running[-1], stderr=[0.1, 0.1]
    )
    figure = plotting.lyapunov_convergence(spectrum)
    curves = [x for x in figure.axes[0].lines if "exponent" in str(x.get_label())]
    np.testing.assert_allclose(curves[0].get_xdata(), [2.0, 4.0, 6.0])
    np.testing.assert_allclose(curves[1].get_ydata(), running[:, 1])
    assert len(figure.axes[0].patches) == 2
    plt.close(figure)
    lanes = SimpleNamespace(running=running[None])
    with pytest.raises(ValueError, match="batch"):
        plotting.lyapunov_convergence(lanes)


def test_the_cobweb_lies_on_the_map():
    mu, lam = 0.3, 0.67
    figure = plotting.cobweb(
        lambda x: variational.nordmark_map(x, mu, lam), 0.1, 30, skip=200, edge=mu
    )
    motion = next(x for x in figure.axes[0].lines if x.get_label() == "orbit")
    x, y = (np.asarray(d) for d in motion.get_data())
    # every second corner is on the map, the others on the diagonal
    expected = np.asarray(variational.nordmark_map(x[1::2], mu, lam))
    np.testing.assert_allclose(y[1::2], expected, atol=1e-12)
    np.testing.assert_allclose(x[2::2], y[2::2], atol=1e-12)
    plt.close(figure)
    with pytest.raises(ValueError, match="diverges"):
        plotting.cobweb(lambda x: 1e200 * x, 1.0, 10)
