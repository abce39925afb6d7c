// SPDX-License-Identifier: GPL-3.0-or-later
// r4::commissioning for r4link/commissioning.py. The GIL is held only while the person is asked.
#include "r4link/commissioning/commissioning.hpp"

#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "py_board.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4::python {
namespace {

using commissioning::Answer;
using commissioning::Check;
using commissioning::Movement;
using commissioning::Question;

constexpr const char* answer_kinds[] = {"yes_no", "number", "choice"};

class PyPerson final : public commissioning::Person {
 public:
  explicit PyPerson(py::object person) : person_(std::move(person)) {}

  void say(std::string_view check, std::string_view text) override {
    const py::gil_scoped_acquire gil;
    person_.attr("say")(check, text);
  }
  Answer ask(const Question& question) override {
    const py::gil_scoped_acquire gil;
    return answer_of(person_.attr("ask")(question.check, to_text(question.topic), question.text,
                                         answer_kinds[static_cast<std::size_t>(question.kind)],
                                         question.choices, question.unit));
  }
  Answer await_key(const Movement& movement) override {
    const py::gil_scoped_acquire gil;
    return answer_of(person_.attr("await_key")(movement.check, movement.text,
                                               shown(movement.command),
                                               static_cast<double>(movement.most.count()) / 1e3));
  }
  bool holds_key() override {
    const py::gil_scoped_acquire gil;
    return person_.attr("holds_key")().cast<bool>();
  }

 private:
  static Answer answer_of(const py::object& answer) {
    const auto [kind, yes, number, choice] =
        answer.cast<std::tuple<int, bool, double, std::size_t>>();
    return {static_cast<Answer::Kind>(kind), yes, number, choice};
  }

  py::object person_;
};

class PyCommissioning {
 public:
  PyCommissioning(PyBoard& board, py::object person, std::vector<std::string> others,
                  const std::string& resume)
      : person_(std::move(person)),
        tested_(*board.operator->(), std::move(others)),
        work_(tested_, person_,
              resume.empty() ? commissioning::Report()
                             : commissioning::read_report(resume, "resume")) {}

  template <class Work>
  bool work(Work what) {
    const py::gil_scoped_release free;
    return what(work_) == commissioning::Commissioning::End::done;
  }
  const commissioning::Report& report() const { return work_.report(); }

 private:
  PyPerson person_;
  commissioning::BoardOnLink tested_;
  commissioning::Commissioning work_;
};

std::vector<std::tuple<std::string, std::string, std::string, std::string>> all_checks() {
  std::vector<std::tuple<std::string, std::string, std::string, std::string>> all;
  all.reserve(commissioning::checks().size());
  for (const Check& each : commissioning::checks()) {
    all.emplace_back(each.id, to_text(each.section), each.moves, each.about);
  }
  return all;
}

}  // namespace

void bind_commissioning(py::module_& module) {
  module.def("commissioning_checks", all_checks);
  py::class_<PyCommissioning>(module, "Commissioning")
      .def(py::init<PyBoard&, py::object, std::vector<std::string>, const std::string&>(),
           py::keep_alive<1, 2>())
      .def("run",
           [](PyCommissioning& self, const std::string& check) {
             return self.work([&](auto& work) { return work.run(check); });
           })
      .def("run_all",
           [](PyCommissioning& self, const std::vector<std::string>& only) {
             return self.work([&](auto& work) { return work.run_all(only); });
           })
      .def("offer",
           [](PyCommissioning& self) { return self.work([](auto& work) { return work.offer(); }); })
      .def("json", [](const PyCommissioning& self) { return write_json(self.report()); })
      .def("html", [](const PyCommissioning& self) { return write_html(self.report()); });
}

}  // namespace r4::python
