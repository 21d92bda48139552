"""Operations of the LLVM backend against those of XLA, one by one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxcam.hybrid.backend import Lacking, Mapped, vector_width


# numbers below the normal ones are left out: XLA takes them for zero
_SPECIAL = [0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 3e-308, -3e-308, 1e308]


def _numbers(seed: int, count: int, low=-300, high=300):
    rng = np.random.default_rng(seed)
    wide = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(low, high, count)
    return np.concatenate([_SPECIAL, rng.normal(size=count), wide])


def _pairs(seed: int, count: int = 200):
    a, b = _numbers(seed, count), _numbers(seed + 1, count)
    every = np.array([(x, y) for x in _SPECIAL for y in _SPECIAL])
    return np.concatenate([every, np.stack([a, b], axis=1)])


def both(function, own, width=None):
    """Results of the backend and of XLA, each `(count, results)`."""
    own = np.asarray(own)

    def listed(_, own):
        made = function(*own)
        return made if isinstance(made, (list, tuple)) else [made]

    mine = Mapped(listed, 0, own.shape[1], width)(np.zeros(0), own)
    made = jax.jit(jax.vmap(lambda row: listed(None, row)))(jnp.asarray(own))
    return mine, np.stack([np.asarray(m, dtype=float) for m in made], axis=1)


def assert_equal(mine, made, ulps: float = 0.0, signs: bool = True):
    """Equal up to some units in the last place, NaN and signs of zeros included."""
    np.testing.assert_array_equal(np.isnan(mine), np.isnan(made))
    both = np.isfinite(made)
    np.testing.assert_array_equal(
        mine[~both & ~np.isnan(made)], made[~both & ~np.isnan(made)]
    )
    error = np.abs(mine[both] - made[both])
    assert np.all(error <= ulps * np.spacing(np.abs(made[both])))
    zero = (made == 0) & signs
    np.testing.assert_array_equal(np.signbit(mine[zero]), np.signbit(made[zero]))


_TWO = {
    "add": lax.add,
    "sub": lax.sub,
    "mul": lax.mul,
    "div": lax.div,
    "max": lax.max,
    "min": lax.min,
    "rem": lax.rem,
    "less": lambda a, b: (a < b, a <= b, a > b, a >= b, a == b, a != b),
    "logic": lambda a, b: ((a < b) & ~(a > 0), (a < b) | (b > 0), (a < 0) ^ (b < 0)),
    "choice": lambda a, b: jnp.where(a > b, a, b),
    "clamped": lambda a, b: (jnp.clip(a, -1.0, 1.0), lax.clamp(-1.0, a, b)),
    "one known": lambda a, b: (jnp.maximum(a, 0.5), jnp.minimum(-0.5, b)),
}


@pytest.mark.parametrize("width", sorted({1, 2, 4, vector_width()}))
@pytest.mark.parametrize("name", _TWO)
def test_arithmetic_is_exact(name, width):
    """Bit by bit, numbers that are none included."""
    mine, made = both(_TWO[name], _pairs(1), width)
    # results below the normal numbers are zero by XLA
    tiny = (made == 0) & (np.abs(mine) < 2.3e-308)
    # which of two zeros is larger is open
    signs = name not in ("max", "min", "clamped")
    assert_equal(np.where(tiny, made, mine), made, signs=signs)


_ONE = {
    "neg": lax.neg,
    "abs": lax.abs,
    "sign": lax.sign,
    "floor": lax.floor,
    "ceil": lax.ceil,
    "round": lambda a: lax.round(a, lax.RoundingMethod.AWAY_FROM_ZERO),
    "round even": jnp.round,
    "sqrt": lax.sqrt,
    "finite": jnp.isfinite,
    "square": lax.square,
    "powers": lambda a: [a**k for k in (0, 1, 2, 3, 5, 8)],
    "inverse powers": lambda a: [lax.integer_pow(a, -k) for k in (1, 2, 3)],
    "integers": lambda a: [a.astype(kind) for kind in (jnp.int32, jnp.int64, bool)],
    "narrow": lambda a: a.astype(jnp.float32),
}


@pytest.mark.parametrize("name", _ONE)
def test_functions_of_one_number_are_exact(name):
    numbers = np.concatenate([_numbers(2, 300), np.arange(-40, 41) / 4])
    mine, made = both(_ONE[name], numbers[:, None])
    if name == "inverse powers":
        # a power that is below the normal numbers is zero by XLA
        made = np.where(np.isinf(made) & (np.abs(mine) > 4e307), mine, made)
    if name == "narrow":
        made = np.where((made == 0) & (np.abs(mine) < 1.2e-38), mine, made)
    tiny = (made == 0) & (np.abs(mine) < 2.3e-308)
    assert_equal(np.where(tiny, made, mine), made)


def _true(name: str, x):
    """To 40 digits, rounded."""
    import mpmath

    with mpmath.workdps(40):
        others = {
            "exp2": lambda v: mpmath.mpf(2) ** v,
            "sigmoid": lambda v: 1 / (1 + mpmath.exp(-v)),
        }
        function = others[name] if name in others else getattr(mpmath, name)
        return np.array([float(function(mpmath.mpf(v))) for v in x])


@pytest.mark.parametrize(
    ("name", "low", "high"), [("exp", -700, 709), ("log", 1e-300, 1e300)]
)
def test_exponentials_and_logarithms_err_by_one_ulp(name, low, high):
    rng = np.random.default_rng(3)
    near = (
        1 + rng.normal(scale=0.3, size=500) if name == "log" else rng.normal(size=500)
    )
    wide = rng.uniform(low, high, 500)
    if name == "log":
        wide = np.exp(rng.uniform(np.log(low), np.log(high), 500))
        near = np.abs(near)
    x = np.concatenate([near, wide])
    mine, _ = both(getattr(jnp, name), x[:, None])
    error = np.abs(mine[:, 0] - _true(name, x)) / np.spacing(np.abs(_true(name, x)))
    assert np.max(error) <= 1.0


#: of each function its name in mpmath, and the largest argument that is tried
_SLOW_ONES = {
    "exp2": (jnp.exp2, "exp2", 1000.0),
    "expm1": (jnp.expm1, "expm1", 500.0),
    "log1p": (jnp.log1p, "log1p", 1e3),
    "tanh": (jnp.tanh, "tanh", 20.0),
    "sinh": (jnp.sinh, "sinh", 500.0),
    "cosh": (jnp.cosh, "cosh", 500.0),
    "atan": (jnp.arctan, "atan", 1e3),
    "asin": (jnp.arcsin, "asin", 1.0),
    "acos": (jnp.arccos, "acos", 1.0),
    "cbrt": (jnp.cbrt, "cbrt", 1e3),
    "erf": (jax.scipy.special.erf, "erf", 4.0),
    "logistic": (jax.nn.sigmoid, "sigmoid", 30.0),
}


@pytest.mark.parametrize("name", _SLOW_ONES)
def test_other_functions_err_by_little(name):
    """By 2 ulp: one of the C library, one of what is made of it."""
    function, known, most = _SLOW_ONES[name]
    rng = np.random.default_rng(4)
    x = np.concatenate([rng.uniform(-1, 1, 300), rng.uniform(-most, most, 300)])
    x = np.abs(x) if name in ("log1p", "cbrt") else x
    mine, _ = both(function, x[:, None])
    exact = _true(known, x)
    assert np.max(np.abs(mine[:, 0] - exact) / np.spacing(np.abs(exact))) <= 2.0


@pytest.mark.parametrize("name", ["exp", "exp2", "log"])
def test_functions_of_32_bit_floats_err_by_one_ulp(name):
    """Also at the edges: zeros, infinities, NaN, denormal numbers, and overflow."""
    rng = np.random.default_rng(6)
    exponents = rng.uniform(-85, 87, 3000)
    numbers = np.exp(exponents) if name == "log" else exponents
    near = np.concatenate([rng.uniform(0.5, 2.0, 3000), 1 + rng.normal(0, 1e-5, 300)])
    x = np.concatenate([numbers, near]).astype(np.float32).astype(float)

    def function(v):
        return getattr(jnp, name)(v.astype(jnp.float32)).astype(jnp.float64)

    mine, _ = both(function, x[:, None])
    exact = _true(name, x)
    sizes = np.spacing(np.abs(exact).astype(np.float32)).astype(float)
    assert np.max(np.abs(mine[:, 0] - exact) / sizes) <= 1.0
    edges = [0.0, -0.0, -1.0, np.inf, -np.inf, np.nan, 1e30, -1e30, 128.0, -150.5]
    edges = [*edges, 1e-40, -149.0]
    mine, _ = both(function, np.array(edges)[:, None])
    with np.errstate(all="ignore"):
        exact = getattr(np, name)(np.array(edges, np.float32)).astype(float)
    np.testing.assert_allclose(mine[:, 0], exact, rtol=2e-7, atol=0.0)


_EDGES = [*_SPECIAL, 709.7, 709.9, -745.0, -746.0, -750.5, 1024.5, 0.999, -0.999, 1.001]


@pytest.mark.parametrize("name", [*_SLOW_ONES, "exp", "log"])
def test_infinities_and_no_numbers_are_as_by_xla(name):
    function = _SLOW_ONES[name][0] if name in _SLOW_ONES else getattr(jnp, name)
    mine, made = both(function, np.array(_EDGES)[:, None])
    np.testing.assert_array_equal(np.isnan(mine), np.isnan(made))
    np.testing.assert_array_equal(np.isinf(mine), np.isinf(made))
    np.testing.assert_allclose(mine, made, rtol=1e-12, atol=4e-308)


def test_powers_and_angles_agree_with_those_of_xla():
    pairs = _pairs(5)
    pairs = pairs[np.all((np.abs(pairs) < 1e100) | ~np.isfinite(pairs), axis=1)]
    pairs = pairs[np.all((np.abs(pairs) > 1e-100) | (pairs == 0), axis=1)]
    for function in (jnp.arctan2, jnp.power):
        mine, made = both(function, pairs)
        normal = (np.abs(made) > 2.3e-308) | (made == 0) | np.isnan(made)
        keep = normal[:, 0] & (np.abs(mine[:, 0]) != 5e-324)
        assert_equal(mine[keep], made[keep], 8.0)


def test_integers_are_as_those_of_xla():
    """Division by zero, the least number over -1, and shifts by too much."""
    values = [0, 1, -1, 7, -7, 2**31 - 1, -(2**31), 12345]
    pairs = np.array([(a, b) for a in values for b in values], dtype=float)

    def function(a, b):
        a, b = a.astype(jnp.int32), b.astype(jnp.int32)
        return [
            a + b,
            a * b,
            lax.div(a, b),
            lax.rem(a, b),
            lax.shift_left(a, b),
            lax.shift_right_arithmetic(a, b),
            lax.shift_right_logical(a, b),
            jnp.abs(a),
            -a,
            jnp.sign(a),
            a & b,
            a | b,
            a ^ b,
            ~a,
            jnp.maximum(a, b),
            (a < b) | (a == b),
            a.astype(jnp.uint32) // jnp.maximum(b.astype(jnp.uint32), 1),
        ]

    mine, made = both(function, pairs)
    assert_equal(mine, made)


def _array(a, b, c):
    return jnp.stack([a, b, c, a * b, b - c, a + 2 * c])


_ARRAYS = {
    "sums": lambda x: (jnp.sum(x), jnp.max(x), jnp.min(x), jnp.prod(x), jnp.mean(x)),
    "which": lambda x: (jnp.argmax(x), jnp.argmin(x), jnp.any(x > 0), jnp.all(x > 0)),
    "running": lambda x: [*jnp.cumsum(x), *lax.cummax(x, reverse=True)],
    "matrix": lambda x: [*(x[:4].reshape(2, 2).T @ x[2:4]), jnp.dot(x, x)],
    "product": lambda x: [*jnp.ravel(x.reshape(2, 3) @ x.reshape(3, 2))],
    "batch": lambda x: [
        *jnp.einsum("bi,bi->b", x.reshape(3, 2), x.reshape(3, 2)),
    ],
    "pieces": lambda x: [*jnp.concatenate([x[::-1], x[1:3]]), *jnp.roll(x, 2)],
    "padded": lambda x: [*jnp.pad(x, 2, constant_values=3.0)],
    "set": lambda x: [*x.at[2].set(7.0), *x.at[1].add(x[0]), *x.at[0].multiply(x[3])],
    "several": lambda x: [
        *x.at[jnp.array([1, 3, 1])].add(x[:3]),
        *x.at[jnp.array([0, 5])].max(x[2:4]),
        *x.at[1:3].min(0.1),
    ],
    "looked up": lambda x: [x[_index(x)], x.reshape(2, 3)[1, _index(x) % 3]],
    "several looked up": lambda x: [
        *x[_indices(x)],
        *jnp.ravel(x.reshape(2, 3)[_indices(x) % 2]),
        *jnp.ravel(x.reshape(3, 2)[:, _indices(x) % 2]),
    ],
    "nothing": lambda x: [jnp.any(x[:0] > 0), jnp.all(x[:0] > 0), jnp.sum(x[:0])],
    "repeated": lambda x: [*jnp.tile(x[:2], 3)],
    "beyond": lambda x: [x[_index(x) + 4], x.at[_index(x) * 3].get(mode="clip")],
    "slice": lambda x: [*lax.dynamic_slice(x, (_index(x),), (2,))],
    "put": lambda x: [*lax.dynamic_update_slice(x, x[:2], (_index(x),))],
    "table": lambda x: [jnp.interp(x[0], jnp.linspace(-2, 2, 9), jnp.arange(9.0) ** 2)],
    "polynomial": lambda x: [jnp.polyval(x[:4], x[4])],
    "sine": lambda x: [jnp.sin(x[0]), jnp.cos(x[1]), jnp.tan(x[2])],
}


def _index(x):
    return jnp.clip(jnp.floor(jnp.abs(x[0]) * 2), 0, 5).astype(jnp.int32)


def _indices(x):
    return jnp.stack([_index(x), _index(x) // 2, 5 - _index(x)])


@pytest.mark.parametrize("name", _ARRAYS)
def test_small_arrays(name):
    """To rounding: sums may be taken in another order."""
    own = np.random.default_rng(6).normal(size=(50, 3)) * 1.5
    mine, made = both(lambda *row: list(_ARRAYS[name](_array(*row))), own)
    np.testing.assert_allclose(mine, made, rtol=1e-13, atol=1e-14)


def _newton(a):
    def off(carry):
        x, count = carry
        return (jnp.abs(x * x - a) > 1e-12) & (count < 50)

    return lax.while_loop(off, lambda c: (0.5 * (c[0] + a / c[0]), c[1] + 1), (a, 0))


_CONTROL = {
    "cond": lambda a, b: [lax.cond(a > b, lambda: a * 2, lambda: b - 1)],
    "switch": lambda a, b: [
        lax.switch(
            jnp.floor(3 * a).astype(jnp.int32),
            [lambda: a, lambda: b, lambda: a * b, lambda: a - b],
        )
    ],
    "select": lambda a, b: [lax.select_n((2 * a).astype(jnp.int32) % 3, a, b, a + b)],
    "while": lambda a, b: [*_newton(1.5 + a * a), *_newton(2.0 + b * b)],
    "scan": lambda a, b: [
        lax.scan(lambda c, k: (c * 0.9 + k * b, c), a, jnp.arange(5.0))[0],
        *lax.scan(lambda c, k: (c * 0.9 + k * b, c), a, jnp.arange(5.0))[1],
    ],
    "long scan": lambda a, b: [
        lax.scan(lambda c, k: (c * 0.999 + k * b, None), a, jnp.arange(4000.0) / 4000)[
            0
        ],
        *lax.scan(
            lambda c, k: (c * 0.9 + k * b, c),
            a,
            jnp.tile(jnp.arange(3.0), 800),
            reverse=True,
        )[1][::600],
    ],
    "fori": lambda a, b: [lax.fori_loop(0, 7, lambda k, c: c + b * k, a)],
    "loop of its own length": lambda a, b: [
        lax.fori_loop(0, (8 * a * a).astype(int) + 1, lambda k, c: c + b * k, a)
    ],
    "nested": lambda a, b: [
        lax.cond(
            a > 0,
            lambda: _newton(1.0 + a)[0],
            lambda: lax.scan(lambda c, _: (c * b, None), a, None, length=3)[0],
        )
    ],
}


@pytest.mark.parametrize("width", sorted({1, vector_width()}))
@pytest.mark.parametrize("name", _CONTROL)
def test_branches_and_loops(name, width):
    """Batch elements that go different ways do not disturb each other."""
    own = np.random.default_rng(7).normal(size=(37, 2))
    mine, made = both(_CONTROL[name], own, width)
    np.testing.assert_allclose(mine, made, rtol=1e-12, atol=1e-13)


def test_a_loop_does_not_wait_for_those_who_do_not_enter_it():
    """It would never end where the other side is taken."""

    def doubled(a, b):
        # of a number below zero there is no end
        grown = lambda: lax.while_loop(lambda x: x < 1e3, lambda x: 2 * x, a)
        return [lax.cond(a > 0, grown, lambda: b)]

    own = np.array([[1.0, 5.0], [-1.0, 7.0], [3.0, 9.0], [0.0, 2.0]])
    mine = Mapped(lambda _, own: doubled(*own), 0, 2)(np.zeros(0), own)
    np.testing.assert_array_equal(mine[:, 0], [1024.0, 7.0, 1536.0, 2.0])


def test_shared_numbers():
    """A number for all is a number for each; results may need one kind only."""
    function = Mapped(lambda s, x: [s[0] * s[1], x[0] * s[1], x[0] + 1.0], 2, 1)
    made = function(np.array([2.0, 3.0]), np.arange(5.0)[:, None])
    x = np.arange(5.0)
    np.testing.assert_array_equal(made, np.stack([np.full(5, 6.0), 3 * x, x + 1], 1))


def test_what_is_lacking_is_named():
    with pytest.raises(Lacking, match="lu"):
        Mapped(lambda _, x: [jnp.linalg.det(jnp.outer(x, x))], 0, 5)
    with pytest.raises(Lacking, match="sort"):
        Mapped(lambda _, x: [jnp.sort(x)[0]], 0, 3)


def test_a_function_that_prints_is_left_to_xla():
    def printing(shared, own):
        jax.debug.print("{x}", x=own[0])
        return [own[0]]

    with pytest.raises(Lacking, match="debug"):
        Mapped(printing, 0, 1)


_TABLE = np.array([[1.5, -2.0, np.nan], [0.0, -0.0, np.inf]])
_KNOWN = {
    "abs": lax.abs,
    "not": lambda x: lax.bitwise_not(lax.gt(x, np.zeros((2, 3)))),
    "select": lambda x: lax.select_n(lax.gt(x, np.zeros((2, 3))), x, 2 * x),
    "select by one": lambda x: lax.select_n(lax.gt(x[0, 0], 0.0), x, 2 * x),
    "pad": lambda x: lax.pad(x, 7.0, ((1, 0, 0), (0, 2, 0))),
    "pad between": lambda x: lax.pad(x, 7.0, ((1, 0, 1), (0, -1, 0))),
    "stack": lambda x: jnp.stack([x, x[::-1]], axis=1),
    "split": lambda x: lax.split(x, (1, 2), axis=1)[1],
    "slice": lambda x: lax.dynamic_slice(x, (1, 2), (1, 2)),
}


@pytest.mark.parametrize("name", sorted(_KNOWN))
def test_numbers_that_are_known_while_tracing(name):
    """The same as by JAX; the common operations compile nothing."""
    expected, compiled = np.asarray(_KNOWN[name](jnp.asarray(_TABLE))), []

    def listen(event, duration, **about):
        if "backend_compile" in event:
            compiled.append(about)

    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        made = Mapped(lambda _, own: list(_KNOWN[name](_TABLE).ravel()), 0, 1)
        found = made(np.zeros(0), np.zeros((1, 1)))[0]
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)
    assert_equal(found, expected.astype(float).ravel())
    assert not compiled or name == "pad between"
