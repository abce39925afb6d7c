// SPDX-License-Identifier: GPL-3.0-or-later
// Part of r4 under ThreadSanitizer. The runtime of GCC 12 makes the list of a thread's deferred signals at the first
// call that waits. A signal at that moment is lost, because SigCtx() in
// libsanitizer/tsan/tsan_interceptors_posix.cpp then makes two lists, and keeps the empty one. So the first wait is
// here, before r4 handles signals.
#include <unistd.h>

namespace {

const int first_wait = ::usleep(1);

}  // namespace
