// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Error becomes the r4link.errors.Error of its kind and outcome.
#include <exception>

#include "bindings.hpp"

namespace r4::python {
namespace {

void raise(const Error& error) {
  const Problem& problem = error.problem();
  py::object holder = py::none();
  if (error.holder()) holder = py::make_tuple(error.holder()->pid, printable(error.holder()->name));
  const py::object made =
      py::module_::import("r4link.errors")
          .attr("error_of")(static_cast<int>(problem.kind), printable(problem.thing),
                            printable(problem.reason), printable(problem.fix),
                            to_text(problem.outcome), to_str(name_of(problem.refusal)), problem.at,
                            holder);
  PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(made.ptr())), made.ptr());
}

}  // namespace

void bind_errors(py::module_&) {
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const Error& error) {
      raise(error);
    }
  });
}

}  // namespace r4::python
