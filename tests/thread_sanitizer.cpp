// SPDX-License-Identifier: GPL-3.0-or-later
// Part of r4 under ThreadSanitizer. At the first call of a thread that waits, the runtime of GCC 12
// makes the list of the thread's deferred signals. A signal at this moment is lost: SigCtx() in
// libsanitizer/tsan/tsan_interceptors_posix.cpp then makes two lists, and keeps the empty list. So
// the first wait is here, before r4 handles signals.
#include <unistd.h>

namespace {

const int first_wait = ::usleep(1);

}  // namespace
