// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recording.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "process.hpp"
#include "r4link/datagram.hpp"
#include "r4link/devices/device.hpp"

namespace r4::python {
namespace {

// One number of a field, in all states. 0 before the first state with the field.
struct Column {
  StateField field;
  int which;
  std::vector<std::int32_t> numbers;
};

constexpr double not_measured = std::numeric_limits<double>::quiet_NaN();

struct Measured {
  std::shared_ptr<const Device> device;
  std::size_t value;
  std::string value_name, name;  // "gyro_z", and the column's name
  std::vector<double> numbers;
  bool here = true;  // false if another device has replaced the device
};

// The measured values of one board, whose bus has 112 addresses.
constexpr std::size_t most_measured = 1000;

struct RecordedBoard {
  std::string url, name;
  std::vector<std::int64_t> times_us;  // since 1970
  std::vector<std::uint32_t> t_ms, pnum;
  FieldSet fields;
  std::vector<Column> columns;
  std::vector<Measured> measured;
  std::uint64_t damaged = 0;
  std::vector<std::pair<std::int64_t, std::string>> events;
  std::vector<std::tuple<std::int64_t, bool, std::string>> datagrams;
};

// A number as stored in its column: volts in hundredths.
std::int32_t kept(double number, FieldForm form) {
  return static_cast<std::int32_t>(std::llround(form == FieldForm::volts ? 100 * number : number));
}

// "bno055_gyro_z"; with the address for a second device of a kind: "bno055_29_gyro_z".
std::string column_of(const Device& device, const DeviceValue& value,
                      const std::vector<Measured>& others) {
  const std::string& kind = device.description().name;
  const bool another = std::any_of(others.begin(), others.end(), [&](const Measured& each) {
    return each.device->description().name == kind && each.device->address() != device.address();
  });
  const std::string text = device.text();  // "bno055@0x29"
  const std::string address = another ? text.substr(text.find("@0x") + 3) + "_" : "";
  return kind + "_" + address + value.name;
}

class Columns final : public RecordingVisitor {
 public:
  explicit Columns(bool datagrams) : with_datagrams_(datagrams) {}

  // Texts of the file are printable(), because a Python str cannot hold arbitrary bytes.
  void on_path(const RecordedPath& path) override {
    const std::string url = printable(path.url);
    const auto known = std::find_if(boards_.begin(), boards_.end(),
                                    [&url](const RecordedBoard& each) { return each.url == url; });
    const auto index = static_cast<std::size_t>(known - boards_.begin());
    if (known == boards_.end()) boards_.emplace_back().url = url;
    if (!path.name.empty()) boards_[index].name = path.name;
    index_of_[path.number] = index;
  }
  void on_header() override {
    states_.clear();
    for (RecordedBoard& board : boards_) {
      for (Measured& each : board.measured) each.here = false;
    }
  }
  void on_device(const RecordedDevice& told) override {
    RecordedBoard& board = of(told.path);
    std::shared_ptr<const Device> device;
    try {
      device = std::make_shared<const Device>(Device::parse(told.place, told.description));
    } catch (const Error& error) {
      return add_damage(error.what());
    }
    for (Measured& each : board.measured) {
      each.here = each.here && !device->takes_place_of(*each.device);
    }
    const std::string text = device->text();
    const std::vector<DeviceValue>& values = device->description().values;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const auto known =
          std::find_if(board.measured.begin(), board.measured.end(), [&](const Measured& each) {
            return each.value_name == values[i].name && each.device->text() == text;
          });
      if (known != board.measured.end()) {  // its slots may differ
        known->device = device;
        known->value = i;
        known->here = true;
      } else if (board.measured.size() < most_measured) {
        board.measured.push_back({device, i, values[i].name,
                                  column_of(*device, values[i], board.measured),
                                  std::vector<double>(board.pnum.size(), not_measured)});
      } else {
        return add_damage(text + ": one board cannot have so many values of devices");
      }
    }
  }
  void on_record(const r4::Record& record) override {
    const std::int64_t at = record.time.count();
    if (record.kind == RecordKind::event) {
      auto& events = record.path == no_path ? events_ : of(record.path).events;
      events.emplace_back(at, printable(record.bytes));
      return;
    }
    const bool from_board = record.kind == RecordKind::from_board;
    RecordedBoard& board = of(record.path);
    if (with_datagrams_) board.datagrams.emplace_back(at, from_board, record.bytes);
    Datagram datagram;
    if (const State* const state = states_.take(record)) {
      add(board, at, *state);
    } else if (!read_datagram(Text(record.bytes), datagram)) {
      ++board.damaged;
    }
  }
  void on_damage(const RecordingDamage& damage) override { add_damage(to_text(damage)); }

  py::tuple take();

 private:
  static void add(RecordedBoard& board, std::int64_t at, const State& state) {
    for (const StateField field : state.present) {
      if (board.fields.has(field)) continue;
      board.fields.add(field);
      for (int which = 0; which < numbers_of(state, field).count; ++which) {
        board.columns.push_back({field, which, std::vector<std::int32_t>(board.pnum.size())});
      }
    }
    board.times_us.push_back(at);
    board.t_ms.push_back(state.t_ms);
    board.pnum.push_back(state.pnum);
    for (Column& column : board.columns) {
      const double number = numbers_of(state, column.field)[column.which];
      column.numbers.push_back(kept(number, kind_row_of(column.field).form));
    }
    for (Measured& each : board.measured) {
      double number = not_measured;
      if (each.here) {
        number = each.device->reading(state, each.value).number.value_or(not_measured);
      }
      each.numbers.push_back(number);
    }
  }
  void add_damage(const std::string& words) { damage_.push_back(printable(words)); }
  RecordedBoard& of(std::uint16_t path) {
    if (!index_of_.contains(path)) on_path({path, "path " + std::to_string(path), ""});
    return boards_[index_of_[path]];
  }

  const bool with_datagrams_;
  std::vector<RecordedBoard> boards_;
  std::map<std::uint16_t, std::size_t> index_of_;
  RecordedStates states_;
  std::vector<std::pair<std::int64_t, std::string>> events_;
  std::vector<std::string> damage_;
};

// Does not copy the numbers.
template <class Number>
py::array_t<Number> to_array(std::vector<Number>&& numbers) {
  auto owned = std::make_unique<std::vector<Number>>(std::move(numbers));
  const std::vector<Number>& all = *owned;
  const py::capsule owner(owned.get(), [](void* pointer) {
    std::default_delete<std::vector<Number>>()(static_cast<std::vector<Number>*>(pointer));
  });
  static_cast<void>(owned.release());
  return py::array_t<Number>(static_cast<py::ssize_t>(all.size()), all.data(), owner);
}

// The name of a field and one of its numbers: "osmc1_pwm".
std::string column_of(StateField field, int which) {
  const std::string_view value = kind_row_of(field).values[which].name;
  std::string name = attribute_of(field);
  if (value.empty()) return name;
  if (value == "direction") return name + "_dir";
  if (value == "t") return name + "_t_ms";
  if (value == "command") return name + "_pnum";
  return name.append("_").append(value);
}

const char* type_of(StateField field, int which) {
  switch (kind_row_of(field).form) {
    case FieldForm::volts:
      return "f8";
    case FieldForm::handle:
      return "u1";
    case FieldForm::drive:
      return which == 0 ? "u2" : "u1";
    case FieldForm::bldc:
      return which == 0 ? "u2" : which == 1 ? "u1" : "?";
    case FieldForm::reason:
    case FieldForm::fault:
      return "u1";
    case FieldForm::answer:
      return which == 0 ? "u4" : "u1";
    case FieldForm::bus:
      return which == 0 ? "u1" : "u4";
    case FieldForm::reading:  // its bytes are in the datagrams
    case FieldForm::uart:
    case FieldForm::u8:
    case FieldForm::u32:
      return "u4";
    default:
      return "i4";
  }
}

// Returns (boards, events, damage). A board is (url, name, damaged, times, t_ms, pnum, [(column,
// type, numbers)], events, datagrams), with volts in hundredths.
py::tuple Columns::take() {
  py::list boards;
  for (RecordedBoard& board : boards_) {
    py::list columns;
    for (Column& column : board.columns) {
      columns.append(py::make_tuple(column_of(column.field, column.which),
                                    type_of(column.field, column.which),
                                    to_array(std::move(column.numbers))));
    }
    for (Measured& each : board.measured) {
      columns.append(py::make_tuple(each.name, "f8", to_array(std::move(each.numbers))));
    }
    py::list datagrams;
    for (const auto& [at, from_board, bytes] : board.datagrams) {
      datagrams.append(py::make_tuple(at, from_board ? "<" : ">", py::bytes(bytes)));
    }
    boards.append(py::make_tuple(board.url, board.name, board.damaged,
                                 to_array(std::move(board.times_us)),
                                 to_array(std::move(board.t_ms)), to_array(std::move(board.pnum)),
                                 columns, board.events, datagrams));
  }
  return py::make_tuple(boards, events_, damage_);
}

}  // namespace

void bind_recording(py::module_& module) {
  const auto close = [](PyRecording& recording) {
    recording.if_here([](Recording& here) { here.close(); });
  };
  py::class_<PyRecording>(module, "Recording")
      .def(py::init([](const std::filesystem::path& path, std::uint64_t rotate_bytes,
                       std::int64_t rotate_after_s, std::uint64_t keep_bytes) {
             const RecordingOptions options{rotate_bytes, std::chrono::seconds(rotate_after_s),
                                            keep_bytes};
             return PyRecording("the recording",
                                std::make_unique<Recording>(path.string(), options));
           }),
           py::arg("path"), py::kw_only(), py::arg("rotate_bytes") = 0, py::arg("rotate_after") = 0,
           py::arg("keep_bytes") = 0, py::call_guard<py::gil_scoped_release>())
      .def("__enter__", [](py::object recording) { return recording; })
      .def("__exit__",
           [close](PyRecording& recording, const py::args&) {
             const py::gil_scoped_release free;
             close(recording);
           })
      .def("close", close, py::call_guard<py::gil_scoped_release>())
      .def_property_readonly("problem",
                             [](const PyRecording& recording) -> std::optional<std::string> {
                               const auto problem = recording->problem();
                               if (!problem) return std::nullopt;
                               return problem->text();
                             })
      .def_property_readonly("records",
                             [](const PyRecording& recording) { return recording->records(); })
      .def_property_readonly("dropped",
                             [](const PyRecording& recording) { return recording->dropped(); });
  module.def("read", [](const std::string& path, bool datagrams) {
    Columns columns(datagrams);
    {
      const py::gil_scoped_release free;
      read_recording(path, columns);
    }
    return columns.take();
  });
}

}  // namespace r4::python
