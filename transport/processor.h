#pragma once

namespace afterglow {

/// Goes on as the twin of this program that is compiled for newer processors (x86-64-v3: AVX2, FMA),
/// where the processor is one and the twin is installed: then it does not return. Returns where it is
/// not, and in the twin itself. The two give results that differ in rounding.
/// AFTERGLOW_PORTABLE=1 in the environment keeps to the portable program.
/// Call it first in main, with main's argv.
void run_faster_twin(char** argv);

} // namespace afterglow
