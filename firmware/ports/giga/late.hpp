// SPDX-License-Identifier: GPL-3.0-or-later
// Room for an object that is constructed later, or never, without a heap.
#pragma once

#include <new>
#include <utility>

namespace r4 {
namespace giga {

template <class T>
class Late {
 public:
  Late() = default;
  Late(const Late&) = delete;
  Late& operator=(const Late&) = delete;
  ~Late() {
    if (object_ != nullptr) object_->~T();
  }
  // Call at most once.
  template <class... Arguments>
  T& make(Arguments&&... arguments) {
    object_ = new (place_) T(std::forward<Arguments>(arguments)...);
    return *object_;
  }
  bool made() const { return object_ != nullptr; }
  T& operator*() { return *object_; }
  T* operator->() { return object_; }

 private:
  alignas(T) unsigned char place_[sizeof(T)];
  T* object_ = nullptr;
};

}  // namespace giga
}  // namespace r4
