// SPDX-License-Identifier: GPL-3.0-or-later
#include <pybind11/stl.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "r4link/fleet.hpp"
#include "r4link/options.hpp"

namespace r4::python {
namespace {

using Released = py::call_guard<py::gil_scoped_release>;
// Its name, whether it is up, and the counters in their order.
using End = std::tuple<std::string, bool, std::vector<std::uint64_t>>;

End end_of(const BridgeEnd& end) {
  const BridgeCounters& from = end.from;
  return {end.name,
          end.up,
          {from.passed, from.stops, from.damaged, from.misdirected, from.kept_out, from.refused,
           from.late, from.undelivered, from.outdated}};
}

// A bridge of this process. One that was inherited by a fork has no thread, and is left alone.
class PyBridge {
 public:
  PyBridge(const std::string& hosts, const std::string& board, int timeout_ms,
           const std::vector<std::string>& keys, bool open) {
    BridgeOptions options;
    options.timeout = std::chrono::milliseconds(timeout_ms);
    options.open = open;
    const py::gil_scoped_release free;
    for (const std::string& path : keys) options.keys.push_back(load_key(path));
    bridge_ = std::make_unique<Bridge>(hosts, board, std::move(options));
  }
  ~PyBridge() {
    if (::getpid() != process_) {
      static_cast<void>(bridge_.release());
      return;
    }
    const py::gil_scoped_release free;
    bridge_.reset();
  }
  PyBridge(const PyBridge&) = delete;
  PyBridge& operator=(const PyBridge&) = delete;

  void close() {
    if (::getpid() == process_) bridge_->close();
  }
  std::vector<std::pair<End, End>> status() const {
    if (::getpid() != process_) {
      throw Error(Problem{ErrorKind::refused, "the bridge",
                          "it was opened by the process " + std::to_string(process_) +
                              ", of which this one is a fork",
                          "open it here, after the fork", Outcome::closed});
    }
    std::vector<std::pair<End, End>> all;
    for (const BridgeStatus& each : bridge_->status()) {
      all.emplace_back(end_of(each.hosts), end_of(each.board));
    }
    return all;
  }

 private:
  const pid_t process_ = ::getpid();
  std::unique_ptr<Bridge> bridge_;
};

}  // namespace

void bind_bridge(py::module_& module) {
  py::class_<PyBridge>(module, "Bridge")
      .def(py::init<const std::string&, const std::string&, int, const std::vector<std::string>&,
                    bool>(),
           py::arg("hosts"), py::arg("board"), py::kw_only(), py::arg("timeout"), py::arg("keys"),
           py::arg("open"))
      .def("close", &PyBridge::close, Released())
      .def("status", &PyBridge::status, Released());
}

}  // namespace r4::python
