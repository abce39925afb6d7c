// SPDX-License-Identifier: GPL-3.0-or-later
// A callback that may be replaced, by itself too, while it runs. Of one thread.
#pragma once

#include <functional>
#include <memory>
#include <utility>

namespace r4 {

template <class Signature>
class Callback {
 public:
  // An empty function turns it off.
  void set(std::function<Signature> function) {
    function_ =
        function ? std::make_shared<const std::function<Signature>>(std::move(function)) : nullptr;
  }
  template <class... Arguments>
  void operator()(const Arguments&... arguments) const {
    if (const auto running = function_) (*running)(arguments...);
  }

 private:
  std::shared_ptr<const std::function<Signature>> function_;
};

}  // namespace r4
