"""Running averages of the two Lyapunov exponents of a chaotic impact oscillator: one
exponent is positive; the bands show the standard errors."""

import variational
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import lyapunov_convergence


system = ImpactOscillator(omega=2.9, restitution=0.8, wall=0.0)
spectrum = variational.lyapunov_spectrum(system, [-0.5, 0.5], turns=150)
figure = lyapunov_convergence(spectrum)
