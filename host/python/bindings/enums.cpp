// SPDX-License-Identifier: GPL-3.0-or-later
#include "enums.hpp"

#include <cstddef>

#include "bindings.hpp"

namespace r4::python {

PythonEnum::PythonEnum(const char* name, WordOf word_of)
    : class_(py::module_::import("r4link.enums").attr(name).cast<py::object>().release()) {
  constexpr std::uint8_t no_enumerator = 255;
  other_ = word_of(no_enumerator);
  std::string word = word_of(0);
  for (std::uint8_t number = 1; number != no_enumerator; ++number) {
    members_.push_back(class_(word).release());
    word = word_of(number);
    if (word == other_) break;
  }
}

py::handle PythonEnum::member(std::uint8_t number) const {
  return number < members_.size() ? members_[number] : py::handle(class_(other_).ptr());
}

std::uint8_t PythonEnum::number(py::handle word) const {
  const py::object found = class_(word);
  for (std::size_t i = 0; i < members_.size(); ++i) {
    if (members_[i].is(found)) return static_cast<std::uint8_t>(i);
  }
  throw Error(ErrorKind::usage, py::str(found), "this value has no number", "give another value");
}

py::tuple PythonEnum::members() const {
  py::tuple all(members_.size());
  for (std::size_t i = 0; i < members_.size(); ++i) all[i] = members_[i];
  return all;
}

void bind_enums(py::module_& module) {
  py::dict all;
#define R4_MEMBERS(name, Enum) all[#name] = python_enum<Enum>(#name).members();
  R4_ENUMS(R4_MEMBERS)
#undef R4_MEMBERS
  module.attr("ENUMS") = all;
}

}  // namespace r4::python
