"""The peak rate of fused multiply-adds on doubles, measured: what a core could do at most.

The kernel carries a number of independent chains x <- a x + b, each a vector of doubles, so many
that the latency of one hides behind the others. Which width and how many chains reach the peak
depends on the processor, so several shapes are tried and the fastest counts.
"""

from collections.abc import Callable

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .timing import Pace

SHAPES = ((2, 16), (4, 10), (8, 10))
"""(doubles in a vector, chains): for 128, 256 and 512 bits, within the registers there are."""

TURNS = 1_000_000
"""About 10 ms."""


def chains_kernel(width: int, chains: int) -> Callable[[int, float, float], float]:
    """Function (turns, a, b) -> sum of all x after so many turns, from x = 1, 2, 3 ...

    The vectors are written as such: a compiler left to find them falls short by half.
    """
    vector, double, index = ir.VectorType(ir.DoubleType(), width), ir.DoubleType(), ir.IntType(32)
    multiply_add = f"llvm.fma.v{width}f64"

    @intrinsic
    def advance(_context, turns, a, b):
        def generate(_context, builder, _signature, args):
            count, *factors = args
            spread = []
            for factor in factors:
                whole = ir.Constant(vector, ir.Undefined)
                for k in range(width):
                    whole = builder.insert_element(whole, factor, ir.Constant(index, k))
                spread.append(whole)
            kind = ir.FunctionType(vector, [vector] * 3)
            fma = ir.Function(builder.module, kind, multiply_add)
            before, loop = builder.block, builder.append_basic_block()
            builder.branch(loop)
            builder.position_at_end(loop)
            turn = builder.phi(count.type)
            xs = [builder.phi(vector) for _ in range(chains)]
            ahead = [builder.call(fma, [x, *spread]) for x in xs]
            next_turn = builder.add(turn, ir.Constant(count.type, 1))
            turn.add_incoming(ir.Constant(count.type, 0), before)
            turn.add_incoming(next_turn, loop)
            for chain, (x, advanced) in enumerate(zip(xs, ahead, strict=True)):
                first = [float(1 + chain * width + k) for k in range(width)]
                x.add_incoming(ir.Constant(vector, first), before)
                x.add_incoming(advanced, loop)
            end = builder.append_basic_block()
            builder.cbranch(builder.icmp_signed("<", next_turn, count), loop, end)
            builder.position_at_end(end)
            total = ir.Constant(double, 0.0)
            for advanced in ahead:
                for k in range(width):
                    one = builder.extract_element(advanced, ir.Constant(index, k))
                    total = builder.fadd(total, one)
            return total

        return types.float64(types.intp, types.float64, types.float64), generate

    # Not kept on disk: no other process would know the intrinsic again.
    @numba.njit(nogil=True)
    def kernel(turns, a, b):
        return advance(turns, a, b)  # pyright: ignore[reportCallIssue]

    return kernel


def measured_peak(pace: Pace) -> float:
    """Floating-point operations a second on the core this runs on, two to a multiply-add."""
    best = 0.0
    for width, chains in SHAPES:
        kernel = chains_kernel(width, chains)
        timing = pace.measure(lambda kernel=kernel: kernel(TURNS, 0.999999, 1e-6))
        best = max(best, 2.0 * width * chains * TURNS / timing.fastest)
    return best
