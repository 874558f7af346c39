"""Formulas compiled to machine code: recorded as graphs, differentiated, written as LLVM assembly."""
