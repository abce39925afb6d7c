// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace r4::tool {

// Returns the exit code: 0 for success, else the ErrorKind (r4link/error.hpp). An error is one line
// on stderr, "r4: thing: reason; fix", and with --json also an object on stdout.
int run(int argc, const char* const* argv);

}  // namespace r4::tool
