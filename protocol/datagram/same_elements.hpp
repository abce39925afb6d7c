// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace r4 {

template <class T, int N>
bool same_elements(const T (&a)[N], const T (&b)[N]) {
  for (int i = 0; i < N; ++i) {
    if (a[i] != b[i]) return false;
  }
  return true;
}

}  // namespace r4
