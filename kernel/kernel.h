// Language-level conventions of kernel code: linkage, assertions and rare-branch checks live in two tiny
// headers (this one and assert.h) so that every kernel file can include them without pulling anything in.
#pragma once

/// Linkage of every kernel function. Hot translation units are compiled once per instruction set; internal
/// linkage keeps the linker from merging an AVX2 body into code that a baseline machine runs.
#define RELIEF_KERNEL [[maybe_unused]] static inline
