// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../formats/output_file.hpp"
#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "plot_script.hpp"
#include "r4link/error.hpp"
#include "r4link/messages/message.hpp"
#include "r4link/tables/state_fields.hpp"
#include "read_file.hpp"
#include "recording_summary.hpp"

namespace r4::tool {
namespace {

struct PlotOptions {
  std::string file;
  std::vector<std::string> fields;
  std::string output;
  bool force = false;
};

// A requested field: "AIN24", "left-arm:AIN24".
struct Wanted {
  std::string board;  // name, URL or path number; empty: all boards
  StateField field;
};

Wanted to_wanted(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  std::string name = colon == std::string::npos ? text : text.substr(colon + 1);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  const StateField field = state_field(Text(name));
  if (field == StateField::count) {
    throw Error(ErrorKind::usage, text, "is not a field of a state",
                "use a field of docs/reference/protocol.md, such as AIN24, OSMC1 or ENC1");
  }
  return {colon == std::string::npos ? std::string() : text.substr(0, colon), field};
}

std::string format_of(const std::string& path) {
  for (const char* format : {"svg", "png", "pdf"}) {
    if (path.ends_with(std::string(".") + format)) return format;
  }
  throw Error(ErrorKind::usage, "--output " + path, "does not have the ending of a picture format",
              "use a name that ends in .svg, .png or .pdf");
}

bool has_direction(StateField field) {
  const FieldForm form = kind_row_of(field).form;
  return form == FieldForm::drive || form == FieldForm::bldc;
}

// times in seconds
struct Curve {
  std::vector<double> times, values;
};

struct Span {
  int reason;  // SafeReason; -1: the board was silent
  Time from, to;
};

struct PlottedPath {
  RecordedPath recorded;
  std::map<StateField, Curve> curves;
  std::vector<Span> spans;
  SafeReason safe = SafeReason::none;
  Time safe_since{0};
  Time last{0};
  bool heard = false;
};

class Curves final : public RecordingVisitor {
 public:
  explicit Curves(const std::vector<Wanted>& wanted) : wanted_(wanted) {}

  void on_path(const RecordedPath& path) override { paths_[path.number].recorded = path; }
  void on_damage(const RecordingDamage&) override { ++damage_; }
  void on_record(const Record& record) override {
    if (!any_) first_ = record.time;
    any_ = true;
    last_ = std::max(last_, record.time);
    if (record.kind != RecordKind::from_board) return;
    Datagram datagram;
    if (!read_datagram(Text(record.bytes), datagram)) return;
    PlottedPath& path = paths_[record.path];
    path.recorded.number = record.path;
    if (path.heard && record.time - path.last > shortest_gap) {
      end_safe(path, path.last);
      path.spans.push_back({-1, path.last, record.time});
      path.safe_since = record.time;
    }
    path.heard = true;
    path.last = record.time;
    const MessageKind kind = kind_of(datagram);
    if (kind != MessageKind::state && kind != MessageKind::board_heartbeat) return;
    State state;
    if (kind == MessageKind::state && !read_state(datagram, state)) return;
    be_safe(path, heartbeat_report(datagram).reason, record.time);
    if (kind == MessageKind::state) take(path, state, record.time);
  }
  void finish() {
    for (auto& [number, path] : paths_) end_safe(path, path.last);
  }

  bool damaged() const { return damage_ != 0; }
  double seconds_of(Time time) const {
    return std::chrono::duration<double>(time - first_).count();
  }
  Time first() const { return first_; }
  Time last() const { return last_; }
  const std::map<std::uint16_t, PlottedPath>& paths() const { return paths_; }

  static std::string name_of(const PlottedPath& path) {
    if (!path.recorded.name.empty()) return path.recorded.name;
    if (path.recorded.url.empty()) return fmt::format("path {}", path.recorded.number);
    return printable(path.recorded.url);
  }
  static bool is_called(const PlottedPath& path, const std::string& name) {
    return name.empty() || name == path.recorded.name || name == path.recorded.url ||
           name == std::to_string(path.recorded.number);
  }

 private:
  static void end_safe(PlottedPath& path, Time now) {
    if (path.safe == SafeReason::none || now <= path.safe_since) return;
    path.spans.push_back({static_cast<int>(path.safe), path.safe_since, now});
  }
  static void be_safe(PlottedPath& path, SafeReason reason, Time now) {
    if (reason == path.safe) return;
    end_safe(path, now);
    path.safe = reason;
    path.safe_since = now;
  }
  void take(PlottedPath& path, const State& state, Time now) {
    for (const Wanted& each : wanted_) {
      if (!state.present.has(each.field) || !is_called(path, each.board)) continue;
      const StateNumbers numbers = numbers_of(state, each.field);
      const double value = has_direction(each.field) && numbers[1] == 0 ? -numbers[0] : numbers[0];
      Curve& curve = path.curves[each.field];
      const double at = seconds_of(now);
      if (!curve.times.empty() && curve.times.back() == at) continue;  // requested twice
      curve.times.push_back(at);
      curve.values.push_back(value);
    }
  }

  const std::vector<Wanted>& wanted_;
  std::map<std::uint16_t, PlottedPath> paths_;
  bool any_ = false;
  Time first_{0}, last_{0};
  std::uint64_t damage_ = 0;
};

std::string unit_of(StateField field) {
  const auto& [name, unit] = kind_row_of(field).values[0];
  if (has_direction(field)) return fmt::format("{} [±{}]", name, pwm_max);
  return *name == '\0' ? unit : fmt::format("{} [{}]", name, unit);
}

[[noreturn]] void fail_for_memory() {
  throw Error(ErrorKind::open, "memory for the picture", std::strerror(errno),
              "free some memory, or plot fewer fields");
}

FilePointer make_memory(const char* name) {
  const int descriptor = ::memfd_create(name, MFD_CLOEXEC);
  FilePointer memory(descriptor < 0 ? nullptr : ::fdopen(descriptor, "w+b"));
  if (!memory) fail_for_memory();
  return memory;
}

void write_all(const FilePointer& memory, const void* bytes, std::size_t size) {
  if (std::fwrite(bytes, 1, size, memory.get()) != size) fail_for_memory();
}

FilePointer make_plan(const Curves& curves, const std::vector<Wanted>& wanted,
                      const std::string& title, const std::string& format) {
  Json plan{{"title", printable(title)},
            {"format", format},
            {"seconds", curves.seconds_of(curves.last())},
            {"step", std::chrono::duration<double>(shortest_gap).count()},
            {"curves", Json::array()},
            {"spans", Json::array()}};
  std::vector<const Curve*> drawn;
  const auto plotted = static_cast<std::size_t>(
      std::count_if(curves.paths().begin(), curves.paths().end(),
                    [](const auto& each) { return !each.second.curves.empty(); }));
  for (const auto& [number, path] : curves.paths()) {
    if (path.curves.empty()) continue;
    const std::string board = plotted > 1 ? Curves::name_of(path) + " " : "";
    for (const Wanted& each : wanted) {
      const auto found = path.curves.find(each.field);
      if (found == path.curves.end() || !Curves::is_called(path, each.board)) continue;
      const Curve& curve = found->second;
      if (std::find(drawn.begin(), drawn.end(), &curve) != drawn.end()) continue;
      const Text name = name_of(each.field);
      plan["curves"].push_back({{"label", board + std::string(name.data(), name.size())},
                                {"unit", unit_of(each.field)},
                                {"count", curve.times.size()}});
      drawn.push_back(&curve);
    }
    for (const Span& span : path.spans) {
      const char* const reason =
          span.reason < 0 ? "no data" : to_text(static_cast<SafeReason>(span.reason));
      plan["spans"].push_back({{"label", board + (span.reason < 0 ? "" : "safe: ") + reason},
                               {"reason", span.reason},
                               {"from", curves.seconds_of(span.from)},
                               {"to", curves.seconds_of(span.to)}});
    }
  }
  FilePointer input = make_memory("plan");
  const std::string line = line_of(plan);
  write_all(input, line.data(), line.size());
  for (const Curve* curve : drawn) {
    for (const std::vector<double>* numbers : {&curve->times, &curve->values}) {
      write_all(input, numbers->data(), numbers->size() * sizeof(double));
    }
  }
  if (std::fflush(input.get()) != 0) fail_for_memory();
  return input;
}

// Returns the exit code; empty if `python` does not exist. Runs in /, because Python reads modules
// and settings from the working directory, which may hold downloaded files.
std::optional<int> run_python(const char* python, const FilePointer& plan,
                              const FilePointer& picture) {
  std::rewind(plan.get());
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, "/");
  posix_spawn_file_actions_adddup2(&actions, ::fileno(plan.get()), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ::fileno(picture.get()), STDOUT_FILENO);
  const char* const arguments[] = {python, "-c", plot_script, nullptr};
  pid_t pid = 0;
  const int error =
      ::posix_spawnp(&pid, python, &actions, nullptr, const_cast<char* const*>(arguments), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return {};
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

// Runs plot.py. If the user's own Python has no matplotlib, tries the system's Python.
FilePointer draw(const FilePointer& plan) {
  constexpr int no_matplotlib = 3;
  FilePointer picture = make_memory("picture");
  std::optional<int> code = run_python("python3", plan, picture);
  if (!code || *code == no_matplotlib) code = run_python("/usr/bin/python3", plan, picture);
  if (!code || *code == no_matplotlib) {
    throw Error(ErrorKind::unsupported, "matplotlib", "is not installed, and r4 plot needs it",
                "run as root: apt-get install python3-matplotlib");
  }
  if (*code != 0) {
    throw Error(ErrorKind::unsupported, "matplotlib", "could not draw the picture",
                "read the messages of matplotlib above");
  }
  return picture;
}

int plot(const PlotOptions& options) {
  const std::string format = format_of(options.output);
  std::vector<Wanted> wanted;
  for (const std::string& text : options.fields) wanted.push_back(to_wanted(text));
  OutputFile output(options.output, options.force);
  Curves curves(wanted);
  read_file(options.file, curves);
  curves.finish();
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const bool found = std::any_of(curves.paths().begin(), curves.paths().end(), [&](auto& each) {
      return Curves::is_called(each.second, wanted[i].board) &&
             each.second.curves.contains(wanted[i].field);
    });
    if (found) continue;
    throw Error(
        ErrorKind::data, options.fields[i], "does not occur in the states of " + options.file,
        "check its boards with `r4 info`; a program requests state fields with the command F");
  }
  const FilePointer plan = make_plan(
      curves, wanted, options.file + ", from " + record_time_text(curves.first()), format);
  const FilePointer picture = draw(plan);
  std::rewind(picture.get());
  std::array<char, 65536> piece;
  while (const std::size_t n = std::fread(piece.data(), 1, piece.size(), picture.get())) {
    output.write({piece.data(), n});
  }
  output.finish();
  if (curves.damaged()) {
    print_trouble("r4: {}: some parts could not be read; see r4 info", options.file);
  }
  return curves.damaged() ? static_cast<int>(ErrorKind::data) : 0;
}

constexpr const char* plot_footer =
    R"(The fields are those of docs/reference/protocol.md, in capital or small letters. In a recording of
several boards, left-arm:AIN24 names one board by its name, its URL or the number of its path. A
drive is drawn with its direction, backward below zero. Fields with the same unit share an axis.
Safe states, and pauses of more than a second without data, are shaded. r4 plot needs
python3-matplotlib.

Examples:
  r4 plot drive.r4log AIN24 OSMC1 -o drive.svg
  r4 plot robot.r4log.zst left-arm:ENC1HZ right-arm:ENC1HZ -o arms.png

Exit codes: 0 drawn; 1 drawn, but some parts could not be read, or the file is not a recording, or a
field is missing; 2 usage; 4, 5 a file cannot be read or written; 6 matplotlib is missing.)";

}  // namespace

void add_plot(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<PlotOptions>();
  CLI::App* const command = add_subcommand(root, chosen, "plot", "Draw fields of a recording",
                                           plot_footer, options, plot);
  add_text(*command, "FILE", options->file, "a recording, or - for standard input", file_type,
           Need::required);
  add_texts(*command, "FIELD", options->fields, "the fields, such as AIN24", "FIELD",
            Need::required);
  add_text(*command, "-o,--output", options->output, "the picture: .svg, .png or .pdf", file_type,
           Need::required);
  add_flag(*command, "--force", options->force, "replace an existing file");
}

}  // namespace r4::tool
