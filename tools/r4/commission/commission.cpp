// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/output.hpp"
#include "../shell/subcommands.hpp"
#include "json_person.hpp"
#include "r4link/board.hpp"
#include "r4link/commissioning/commissioning.hpp"
#include "r4link/error.hpp"
#include "result_text.hpp"
#include "terminal_person.hpp"

namespace r4::tool {
namespace {

using commissioning::Commissioning;
using commissioning::Report;

struct CommissionOptions {
  std::vector<std::string> urls;
  std::vector<std::string> only;
  std::string report;
  std::string resume;
  std::string key;
  bool list = false;
  bool json = false;
};

int list_checks(bool json) {
  for (const auto& check : commissioning::checks()) {
    if (json) {
      print_line({{"type", "check"},
                  {"id", check.id},
                  {"section", to_text(check.section)},
                  {"moves", check.moves},
                  {"about", check.about}});
    } else {
      print_text("{:16} {:22} {}{}{}\n", check.id, to_text(check.section), check.about,
                 check.moves.empty() ? "" : " Moves: ", check.moves);
    }
  }
  return 0;
}

class ReportFiles {
 public:
  explicit ReportFiles(const CommissionOptions& options)
      : html_(!options.report.empty()  ? options.report
              : options.resume.empty() ? "commissioning.html"
                                       : options.resume) {
    if (options.report.empty()) html_.replace_extension(".html");
    if (html_.extension() != ".html") {
      throw Error(ErrorKind::usage, "--report " + options.report, "is not the name of an HTML page",
                  "end the name with .html");
    }
    json_ = html_;
    json_.replace_extension(".json");
    if (json_ != options.resume && has_report(json_)) {
      throw Error(ErrorKind::usage, json_.string(), "already has an earlier report",
                  "continue that report with --resume " + json_.string() +
                      ", or name another file with --report");
    }
  }

  void write(const Report& report) const {
    replace(json_, write_json(report));
    replace(html_, write_html(report));
  }
  std::string html() const { return html_.string(); }
  std::string json() const { return json_.string(); }

 private:
  // A run that could not begin leaves a report without checks.
  static bool has_report(const std::filesystem::path& path) {
    return std::filesystem::exists(path) &&
           !commissioning::load_report(path.string()).checks.empty();
  }

  // A run that is killed leaves the earlier file or the whole new file.
  static void replace(const std::filesystem::path& path, const std::string& text) {
    const std::filesystem::path fresh = path.string() + ".new";
    std::ofstream file(fresh, std::ios::binary | std::ios::trunc);
    file << text;
    file.close();
    std::error_code error;
    if (file) std::filesystem::rename(fresh, path, error);
    if (!file || error) {
      throw Error(ErrorKind::open, path.string(),
                  error ? error.message() : std::string(std::strerror(errno)),
                  "name a file in a folder that you may write to: --report FILE.html");
    }
  }

  std::filesystem::path html_;
  std::filesystem::path json_;
};

Report begin(const CommissionOptions& options) {
  if (!options.resume.empty()) return commissioning::load_report(options.resume);
  Report report;
  report.begun = fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(std::time(nullptr)));
  report.url = options.urls.front();
  return report;
}

void tell_end(const CommissionOptions& options, const ReportFiles& files, const Report& report,
              bool left) {
  const std::size_t found = report.found().size();
  if (options.json) {
    print_line({{"type", "report"},
                {"json", files.json()},
                {"html", files.html()},
                {"left", left},
                {"found", found}});
    return;
  }
  print_text("\n{} checks, {} findings: {}\n", report.checks.size(), found, files.html());
  if (left) {
    print_text("continue with: r4 commission {} --resume {}\n", options.urls.front(), files.json());
  }
}

int commission(const CommissionOptions& options) {
  if (options.list) return list_checks(options.json);
  if (options.urls.empty()) {
    throw Error(ErrorKind::usage, "URL", "is missing", "name the board: r4 commission serial:auto");
  }
  for (const std::string& id : options.only) commissioning::check_named(id);
  const ReportFiles files(options);
  const Report begun = begin(options);
  files.write(begun);  // before the checks, because the folder may not be writable
  if (!options.json && ::isatty(STDIN_FILENO) == 0) {
    throw Error(ErrorKind::usage, "standard input", "is not a terminal, so you cannot hold a key",
                "run r4 commission in a terminal, or use --json in a script");
  }

  Board board(options.urls.front(), with_key(options.key));
  commissioning::BoardOnLink tested(board, {options.urls.begin() + 1, options.urls.end()});
  std::unique_ptr<TerminalPerson> at_terminal;
  std::unique_ptr<JsonPerson> at_script;
  if (options.json) {
    at_script = std::make_unique<JsonPerson>();
  } else {
    at_terminal = std::make_unique<TerminalPerson>();
  }
  commissioning::Person& person =
      options.json ? static_cast<commissioning::Person&>(*at_script) : *at_terminal;
  Commissioning work(tested, person, begun);
  work.on_result = [&](const commissioning::CheckResult& result) {
    files.write(work.report());
    if (options.json) {
      print_line(result_json(result));
    } else {
      print_text("{}", result_text(result));
    }
  };
  const bool left = work.run_all(options.only) == Commissioning::End::left ||
                    work.offer() == Commissioning::End::left;
  files.write(work.report());
  tell_end(options, files, work.report(), left);
  return work.report().found().empty() ? 0 : static_cast<int>(ErrorKind::data);
}

constexpr const char* commission_footer =
    R"(Guides you through the checks of a board. First keep the motor supply off (identity, settings, chips,
supplies against a multimeter, handle, encoders, ultrasonic sensors, user buses, transports, relays,
servos). Then lift the wheels off the ground (motor supply, motors, steppers, silence, stop). Further URLs
must lead to the same board.

An output moves only after r4 has announced the movement, and only while you HOLD the space bar: release it
to stop. Only one output moves at a time, and a motor runs at a tenth of full duty for half a second. You
can skip (s) or repeat (r) each step, or leave (q); --resume continues. At the end, r4 asks whether the
board may keep the wiring and the settings that r4 has found (over USB only).

With --json, r4 prints questions and movements as objects, one a line, and reads answers from standard
input:
  {"type":"question","check":…,"topic":…,"text":…,"answer":"yes_no|number|choice","choices":[…]}
      answer with {"answer":true}, {"answer":12.1}, {"answer":"osmc 1"} or {"action":"skip|repeat|leave"}
  {"type":"movement","check":…,"text":…,"command":"O:410,0,1","milliseconds":500}
      answer with {"key":true}; {"key":false} or the end of the input releases the key
  {"type":"check","id":…,"status":"passed|found|skipped|not done|unsupported","measured":[…],"found":[…]}

Examples:
  r4 commission serial:auto
  r4 commission serial:auto udp:auto --report robot-7.html
  r4 commission serial:auto --only 'osmc 1' --only 'encoder 1' --report motor.html
  r4 commission serial:auto --resume robot-7.json

Exit codes: 0 the checks found nothing wrong; 1 the report has findings; 2 usage; 3 the link was lost; 4, 5
the transport or the report cannot be opened.)";

}  // namespace

void add_commission(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<CommissionOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "commission", "Check a new board, and learn how it is wired",
                     commission_footer, options, commission);
  add_texts(*command, "URL", options->urls,
            "the board; further URLs are other transports to the same board", url_type);
  add_repeated(*command, "--only", options->only, "run this check, even if it is already done",
               "CHECK");
  add_text(*command, "--report", options->report,
           "report page with its .json (default commissioning.html, or as --resume)", file_type);
  add_text(*command, "--resume", options->resume, "continue an earlier report, FILE.json",
           file_type);
  add_flag(*command, "--list", options->list, "list the checks in their order");
  add_key(*command, options->key);
  add_json(*command, options->json, "ask and report in JSON, one object a line");
}

}  // namespace r4::tool
