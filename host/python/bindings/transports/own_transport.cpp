// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/transports/own_transport.hpp"

#include <cxxabi.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../callback.hpp"

namespace r4::python {
namespace {

// Returns code(), which may wait for the GIL. Until 3.13, CPython ends a thread that waits for the
// GIL while the interpreter ends. The ending thread would destroy Python objects without the GIL,
// so the thread pauses here for ever. `code` must not own Python objects.
template <class Code>
auto staying(Code code) {
  try {
    return code();
  } catch (const abi::__forced_unwind&) {
    for (;;) ::pause();
  }
}

// `call()` returns a new reference and may run Python code. Throws py::error_already_set.
template <class Call>
py::object from_python(Call call) {
  auto result = py::reinterpret_steal<py::object>(staying(call));
  if (!result) throw py::error_already_set();
  return result;
}

// The methods of an r4link.Transport, for a thread without a state of the interpreter.
class Methods {
 public:
  explicit Methods(const py::object& transport)
      : name_(py::str(transport.attr("name"))),
        held_(new py::object(transport), [](py::object* held) {
          if (interpreter_ends()) return;
          const py::gil_scoped_acquire gil;
          delete held;
        }) {}

  const std::string& name() const { return name_; }
  // `arguments()` returns the arguments, with the GIL. An exception of the method becomes an Error.
  template <class Arguments>
  void call(const char* method, Arguments arguments) const {
    std::optional<py::gil_scoped_acquire> gil;
    staying([&] { gil.emplace(); });
    KeptThreadState::of_this_thread();
    try {
      const py::object function =
          from_python([&] { return PyObject_GetAttrString(held_->ptr(), method); });
      const py::tuple given = arguments();
      from_python([&] { return PyObject_CallObject(function.ptr(), given.ptr()); });
    } catch (const py::error_already_set& error) {
      throw Error(ErrorKind::open, name_, reason_of(error), "");
    }
  }

 private:
  static std::string reason_of(const py::error_already_set& error) {
    std::string reason =
        "the transport raised " + std::string(py::str(error.type().attr("__name__")));
    try {
      const auto text =
          from_python([&] { return PyObject_Str(error.value().ptr()); }).cast<std::string>();
      if (!text.empty()) reason += ": " + text;
    } catch (const py::error_already_set&) {  // the exception has no text
    }
    return reason;
  }

  std::string name_;
  std::shared_ptr<py::object> held_;
};

py::tuple no_arguments() { return py::tuple(); }

class PyTransport final : public OwnTransport {
 public:
  explicit PyTransport(const py::object& transport) : methods_(transport) {}
  std::string name() const override { return methods_.name(); }
  void open(Received received) override {
    methods_.call("_open", [&] {
      return py::make_tuple(py::cpp_function(
          [received](const py::bytes& datagram) { received(std::string_view(datagram)); }));
    });
  }
  void send(std::string_view datagram) override {
    methods_.call("send",
                  [&] { return py::make_tuple(py::bytes(datagram.data(), datagram.size())); });
  }
  void close() override { methods_.call("_close", no_arguments); }

 private:
  const Methods methods_;
};

class PyCanBus final : public OwnCanBus {
 public:
  explicit PyCanBus(const py::object& transport) : methods_(transport) {}
  std::string name() const override { return methods_.name(); }
  void open(Received received) override {
    methods_.call("_open", [&] {
      return py::make_tuple(py::cpp_function(
          [received](std::uint32_t id, const py::bytes& data, bool extended, bool fd) {
            received(id, extended, fd, std::string_view(data));
          }));
    });
  }
  void send(std::uint32_t id, bool extended, bool fd, std::string_view data) override {
    methods_.call("_send_frame", [&] {
      return py::make_tuple(id, py::bytes(data.data(), data.size()), extended, fd);
    });
  }
  void close() override { methods_.call("_close", no_arguments); }

 private:
  const Methods methods_;
};

}  // namespace

std::vector<CarrierMaker> makers_of(const py::list& transports) {
  std::vector<CarrierMaker> makers;
  for (const py::handle each : transports) {
    const auto transport = py::reinterpret_borrow<py::object>(each);
    if (py::hasattr(transport, "_send_frame")) {
      const OwnCanNode node{transport.attr("node").cast<int>(), transport.attr("fd").cast<bool>(),
                            transport.attr("pack").cast<bool>()};
      makers.push_back(carrier_on(std::make_shared<PyCanBus>(transport), node));
    } else {
      makers.push_back(carrier_on(std::make_shared<PyTransport>(transport)));
    }
  }
  return makers;
}

}  // namespace r4::python
