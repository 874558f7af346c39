"""A scheduled graph as LLVM assembly: one loop over directions, several of them at once in every operation.

The function it makes is ``void kernel(i64 count, ptr inputs, ptr outputs, i64 stride)``: an array of pointers to the
inputs, outputs `stride` numbers apart, `count` at least as many as are computed at once. The last step of the loop
overlaps the one before, so that no direction needs a path of its own.

Another, ``void repeated(i64 times, ptr inputs, ptr steps, ptr moving, ptr outputs, i64 step, i64 count, i64 stride)``,
calls it for many sets of inputs: pointers move on by their steps, in bytes, from one to the next.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from model.kernel.elementary import Precision
from model.kernel.expression import Symbol
from model.kernel.schedule import Block, schedule

LANES: dict[Precision, int] = {"float64": 8, "float32": 16}
VECTOR_BYTES = 64

_SMALLEST_SINGLE, _LARGEST_SINGLE = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)

_BINARY = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_CALLS = {"sqrt": "sqrt", "abs": "fabs", "fma": "fma"}


def assembly(
    inputs: Sequence[str],
    uniform: Collection[str],
    outputs: Mapping[int, Symbol],
    precision: Precision,
    counts: Collection[str] = (),
    past_cache: bool = False,
) -> str:
    """LLVM assembly of a kernel.

    Parameters
    ----------
    inputs : sequence of str
        Names of the inputs in the order of their pointers.
    uniform : collection of str
        Those that hold one number for all directions.
    outputs : mapping of int to Symbol
        What to compute, in operations that `lowering` leaves, by the row of the outputs that it goes to.
    precision : Precision
        Type of all inputs and outputs, but for
    counts : collection of str
        Inputs that are 16-bit whole numbers from 0, as cameras give them.
    past_cache : bool
        Outputs go to memory without being read into the cache before; then as many as are computed at once must begin
        at a multiple of their size, in every row, and `count` be a multiple of their number.
    """
    return _Writer(inputs, uniform, precision, counts, past_cache).function(outputs)


class _Writer:
    """Collects the lines of one function."""

    def __init__(
        self,
        inputs: Sequence[str],
        uniform: Collection[str],
        precision: Precision,
        counts: Collection[str],
        past_cache: bool,
    ) -> None:
        self.inputs = list(inputs)
        self.uniform = uniform
        self.counts = counts
        self.single = precision == "float32"
        self.number = "float" if self.single else "double"
        self.lanes = LANES[precision]
        self.whole_number = "i32" if self.single else "i64"
        self.bits = f"<{self.lanes} x {self.whole_number}>"
        self.align = f"align {4 if self.single else 8}"
        self.stored = f"align {VECTOR_BYTES}, !nontemporal !0" if past_cache else self.align
        self.vector = f"<{self.lanes} x {self.number}>"
        self.truth = f"<{self.lanes} x i1>"
        self.suffix = f"v{self.lanes}f{32 if self.single else 64}"
        # Adding it leaves a whole number in the lowest bits.
        self.shift = self.literal(1.5 * 2.0 ** (23 if self.single else 52))
        self.lines: list[str] = []
        self.names: dict[int, str] = {}
        self.counter = 0

    def function(self, outputs: Mapping[int, Symbol]) -> str:
        order = schedule(list(outputs.values()), self.uniform)
        for position in range(len(self.inputs)):
            slot = self.line(f"getelementptr ptr, ptr %inputs, i64 {position}")
            self.line(f"load ptr, ptr {slot}", f"%in{position}")
        for symbol in order.once:
            self.emit(symbol)
        self.lines += ["br label %loop", "loop:"]
        start = len(self.lines)
        label = "loop"
        for step in order.each:
            label = self.block(step, label) if isinstance(step, Block) else self.emit(step, label)
        for row, output in outputs.items():
            offset = self.line(f"mul i64 %stride, {row}")
            place = self.line(f"add i64 {offset}, %i")
            pointer = self.line(f"getelementptr {self.number}, ptr %outputs, i64 {place}")
            self.lines.append(f"store {self.vector} {self.name(output)}, ptr {pointer}, {self.stored}")
        self.lines += [
            f"%after = add i64 %i, {self.lanes}",
            "%finished = icmp sge i64 %after, %count",
            f"%last = sub i64 %count, {self.lanes}",
            "%early = icmp slt i64 %after, %last",
            "%next = select i1 %early, i64 %after, i64 %last",
            "br i1 %finished, label %end, label %loop",
            "end:",
            "ret void",
        ]
        self.lines.insert(start, f"%i = phi i64 [ 0, %entry ], [ %next, %{label} ]")
        body = "\n".join(self.lines)
        declarations = "\n".join(
            f"declare {self.vector} @llvm.{call}.{self.suffix}({', '.join([self.vector] * count)})"
            for call, count in (("sqrt", 1), ("fabs", 1), ("fma", 3))
        )
        return (
            f"{declarations}\n"
            f"define internal void @kernel(i64 %count, ptr noalias %inputs, ptr noalias %outputs, i64 %stride) "
            f"noinline {{\nentry:\n{body}\n}}\n{_repeated(len(self.inputs))}!0 = !{{i32 1}}\n"
        )

    def line(self, instruction: str, name: str | None = None) -> str:
        if name is None:
            self.counter += 1
            name = f"%t{self.counter}"
        self.lines.append(f"{name} = {instruction}")
        return name

    def name(self, symbol: Symbol) -> str:
        return self.literal(symbol.detail) if symbol.operation == "constant" else self.names[symbol.serial]

    def literal(self, value: object) -> str:
        if isinstance(value, bool | np.bool_):
            return f"splat (i1 {'true' if value else 'false'})"
        number = float(value)  # type: ignore[arg-type]
        if self.single:
            # A number that only has to be very small or very large is as small or as large as can be.
            size = abs(number)
            if 0.0 < size < np.inf:
                number = math.copysign(min(max(size, _SMALLEST_SINGLE), _LARGEST_SINGLE), number)
            number = struct.unpack("f", struct.pack("f", number))[0]
        return f"splat ({self.number} 0x{struct.pack('>d', number).hex().upper()})"

    def emit(self, symbol: Symbol, label: str = "entry") -> str:
        if symbol.operation != "constant":
            self.names[symbol.serial] = self.instruction(symbol)
        return label

    def instruction(self, symbol: Symbol) -> str:
        operation, vector, a = symbol.operation, self.vector, [self.name(argument) for argument in symbol.arguments]
        if operation in _BINARY:
            return self.line(f"{_BINARY[operation]} {vector} {a[0]}, {a[1]}")
        if operation in _CALLS:
            arguments = ", ".join(f"{vector} {argument}" for argument in a)
            return self.line(f"call {vector} @llvm.{_CALLS[operation]}.{self.suffix}({arguments})")
        match operation:
            case "input":
                return self.load(str(symbol.detail))
            case "neg":
                return self.line(f"fneg {vector} {a[0]}")
            case "lt" | "le":
                return self.line(f"fcmp o{operation} {vector} {a[0]}, {a[1]}")
            case "and" | "or":
                return self.line(f"{operation} {self.truth} {a[0]}, {a[1]}")
            case "where":
                return self.line(f"select {self.truth} {a[0]}, {vector} {a[1]}, {vector} {a[2]}")
            case "guarded":
                return self.line(f"select {self.truth} {a[0]}, {vector} {a[1]}, {vector} zeroinitializer")
            case "min" | "max":
                smaller = self.line(f"fcmp olt {vector} {a[0]}, {a[1]}")
                first, second = a if operation == "min" else reversed(a)
                return self.line(f"select {self.truth} {smaller}, {vector} {first}, {vector} {second}")
            case "nearest":
                shifted = self.line(f"fadd {vector} {a[0]}, {self.shift}")
                return self.line(f"fsub {vector} {shifted}, {self.shift}")
            case "odd" | "second_bit":
                chosen = f"splat ({self.whole_number} {1 if operation == 'odd' else 2})"
                bit = self.line(f"and {self.bits} {self.whole(a[0])}, {chosen}")
                return self.line(f"icmp ne {self.bits} {bit}, zeroinitializer")
            case "power_of_two":
                return self.power_of_two(a[0])
        raise KeyError(f"{operation} cannot be compiled")

    def load(self, name: str) -> str:
        array = f"%in{self.inputs.index(name)}"
        if name in self.uniform:
            value = self.line(f"load {self.number}, ptr {array}")
            single = self.line(f"insertelement {self.vector} poison, {self.number} {value}, i32 0")
            return self.line(
                f"shufflevector {self.vector} {single}, {self.vector} poison, <{self.lanes} x i32> zeroinitializer"
            )
        if name in self.counts:
            pointer = self.line(f"getelementptr i16, ptr {array}, i64 %i")
            whole = self.line(f"load <{self.lanes} x i16>, ptr {pointer}, align 2")
            return self.line(f"uitofp <{self.lanes} x i16> {whole} to {self.vector}")
        pointer = self.line(f"getelementptr {self.number}, ptr {array}, i64 %i")
        return self.line(f"load {self.vector}, ptr {pointer}, {self.align}")

    def whole(self, number: str) -> str:
        shifted = self.line(f"fadd {self.vector} {number}, {self.shift}")
        return self.line(f"bitcast {self.vector} {shifted} to {self.bits}")

    def power_of_two(self, number: str) -> str:
        kind, (mantissa, bias) = self.whole_number, (23, 127) if self.single else (52, 1023)
        exponent = self.line(f"shl {self.bits} {self.whole(number)}, splat ({kind} {mantissa})")
        biased = self.line(f"add {self.bits} {exponent}, splat ({kind} {bias << mantissa})")
        return self.line(f"bitcast {self.bits} {biased} to {self.vector}")

    def block(self, block: Block, before: str) -> str:
        mask = self.name(block.mask)
        any_lane = self.line(f"bitcast {self.truth} {mask} to i{self.lanes}")
        lit = self.line(f"icmp ne i{self.lanes} {any_lane}, 0")
        inside, after = f"lit{block.mask.serial}", f"after{block.mask.serial}"
        self.lines += [f"br i1 {lit}, label %{inside}, label %{after}", f"{inside}:"]
        for symbol in block.body:
            self.emit(symbol)
        chosen = [
            self.line(f"select {self.truth} {mask}, {self.vector} {self.name(value)}, {self.vector} zeroinitializer")
            for value in (result.arguments[1] for result in block.results)
        ]
        self.lines += [f"br label %{after}", f"{after}:"]
        for result, value in zip(block.results, chosen, strict=True):
            self.names[result.serial] = self.line(
                f"phi {self.vector} [ {value}, %{inside} ], [ zeroinitializer, %{before} ]"
            )
        return after


def _repeated(inputs: int) -> str:
    moves = "\n".join(
        f"""%from{i} = getelementptr ptr, ptr %inputs, i64 {i}
%base{i} = load ptr, ptr %from{i}
%by{i} = getelementptr i64, ptr %steps, i64 {i}
%step{i} = load i64, ptr %by{i}
%far{i} = mul i64 %step{i}, %n
%there{i} = getelementptr i8, ptr %base{i}, i64 %far{i}
%to{i} = getelementptr ptr, ptr %moving, i64 {i}
store ptr %there{i}, ptr %to{i}"""
        for i in range(inputs)
    )
    arguments = "i64 %times, ptr %inputs, ptr %steps, ptr %moving, ptr %outputs, i64 %step, i64 %count, i64 %stride"
    return f"""define void @repeated({arguments}) {{
entry:
br label %loop
loop:
%n = phi i64 [ 0, %entry ], [ %next, %loop ]
{moves}
%far = mul i64 %step, %n
%there = getelementptr i8, ptr %outputs, i64 %far
call void @kernel(i64 %count, ptr %moving, ptr %there, i64 %stride)
%next = add i64 %n, 1
%more = icmp slt i64 %next, %times
br i1 %more, label %loop, label %end
end:
ret void
}}
"""
