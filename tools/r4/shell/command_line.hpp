// SPDX-License-Identifier: GPL-3.0-or-later
// The r4 command: its subcommands, what happens when the command line or a subcommand fails, and
// the exit code (docs: `r4 --help`).
#pragma once

namespace r4::tool {

// Runs `r4` with these arguments and returns its exit code: 0 done, else the ErrorKind of what
// failed (r4link/error.hpp). An error is one line on stderr, "r4: thing: reason; fix", and with
// --json also an object on stdout.
int run(int argc, const char* const* argv);

}  // namespace r4::tool
