// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_line.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <exception>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "exit_code.hpp"
#include "help.hpp"
#include "json.hpp"
#include "r4link/config.hpp"
#include "r4link/error.hpp"
#include "subcommands.hpp"

namespace r4::tool {
namespace {

struct Subcommand {
  std::string_view name;
  void (*add)(CLI::App& root, Action& chosen);
};

constexpr std::array subcommands = std::to_array<Subcommand>({
    {"monitor", add_monitor},
    {"send", add_send},
    {"stop", add_stop},
    {"list", add_list},
    {"doctor", add_doctor},
    {"bridge", add_bridge},
    {"bus", add_bus},
    {"bench", add_bench},
    {"record", add_record},
    {"info", add_info},
    {"convert", add_convert},
    {"plot", add_plot},
    {"replay", add_replay},
    {"metrics", add_metrics},
    {"web", add_web},
    {"ros2", add_ros2},
    {"sim", add_sim},
    {"key", add_key_command},
    {"demo", add_demo},
    {"encode", add_encode},
    {"decode", add_decode},
    {"completion", add_completion},
    {"man", add_man},
    {"devices", add_devices},
    {"upload", add_upload},
    {"wiring", add_wiring},
    {"commission", add_commission},
});

// Adds only the subcommand named by the first argument: declaring all takes longer than a stop.
void add_subcommands(CLI::App& root, Action& chosen, std::string_view first) {
  const bool tells_of_all = first == "completion" || first == "man";
  for (const Subcommand& each : subcommands) {
    if (each.name == first && !tells_of_all) return each.add(root, chosen);
  }
  for (const Subcommand& each : subcommands) each.add(root, chosen);
}

std::string without(std::string text, std::string_view ending) {
  if (text.ends_with(ending)) text.resize(text.size() - ending.size());
  return text;
}

Problem usage_problem(const CLI::App& root, const CLI::ParseError& error) {
  Problem problem{ErrorKind::usage, "", "", ""};
  const std::vector<CLI::App*> used = root.get_subcommands();
  const CLI::App& command = used.empty() ? root : *used.front();
  const std::string help = used.empty() ? "r4 --help" : "r4 " + command.get_name() + " --help";
  problem.fix = "see " + help;

  const std::vector<std::string> extras = root.remaining(true);
  const bool unexpected = used.empty() || dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
  if (unexpected && !extras.empty()) {
    problem.thing = extras.front();
    const bool option = problem.thing.starts_with('-');
    problem.reason = option         ? "this is not an option"
                     : used.empty() ? "this is not a command"
                                    : "this is one argument too many";
    const std::string near = nearest_name(command, problem.thing);
    if (!near.empty()) problem.fix = fmt::format("did you mean {}? see {}", near, help);
  } else if (used.empty()) {
    problem.thing = "command";
    problem.reason = "the command is missing";
    problem.fix = "give a command that r4 --help lists; r4 demo explains R4";
  } else if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    problem.thing = without(error.what(), " is required");
    problem.reason = "is missing";
  } else if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    problem.thing = std::string(error.what()).substr(0, std::string(error.what()).find(':'));
    problem.reason = "needs a value";
  } else if (dynamic_cast<const CLI::ExcludesError*>(&error) != nullptr) {
    const std::string text = error.what();  // "URL excludes --plain"
    constexpr std::string_view between = " excludes ";
    const std::size_t at = text.find(between);
    problem.thing = text.substr(at + between.size());
    problem.reason = "cannot be combined with " + text.substr(0, at);
    problem.fix = fmt::format("leave out one of the two; {} explains both", help);
  } else {
    const std::string_view text = error.what();
    const std::size_t colon = text.find(": ");
    problem.thing =
        colon == std::string_view::npos ? "command line" : std::string(text.substr(0, colon));
    problem.reason =
        colon == std::string_view::npos ? std::string(text) : std::string(text.substr(colon + 2));
  }
  return problem;
}

int report(Problem problem, bool json) {
  if (problem.thing.empty()) problem.thing = "''";
  print_trouble("r4: " + problem.text());
  if (json) print_line(problem_json(problem));
  return exit_code(problem.kind);
}

// If a standard stream is closed, the next opened port would get its number, and printed text would
// go to a board. /dev/null opened in the wrong direction makes such output fail instead.
void occupy_standard_streams() {
  for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; ++fd) {
    if (::fcntl(fd, F_GETFD) < 0) (void)::open("/dev/null", fd == 0 ? O_WRONLY : O_RDONLY);
  }
}

}  // namespace

int run(int argc, const char* const* argv) {
  occupy_standard_streams();
  const auto is_json = [](const char* argument) { return std::string_view(argument) == "--json"; };
  const bool json = std::any_of(argv, argv + argc, is_json);
  Action chosen;
  CLI::App root("Watch, command, stop and simulate R4 boards", "r4");
  root.set_version_flag("--version", "r4 " R4LINK_VERSION, "Print the version and exit");
  root.set_help_flag("-h,--help", "Print help and exit; also after a command");
  root.footer(root_footer);
  root.require_subcommand(1);
  add_subcommands(root, chosen, argc > 1 ? argv[1] : "");
  set_help_layout(root);
  try {
    int code = 0;
    try {
      root.parse(argc, argv);
      code = chosen();
    } catch (const CLI::Success& success) {
      std::ostringstream text;
      code = root.exit(success, text);
      print_raw(text.str());
    }
    require_output();
    return code;
  } catch (const CLI::ParseError& error) {
    return report(usage_problem(root, error), json);
  } catch (const Error& error) {
    return report(error.problem(), json);
  } catch (const std::system_error& error) {
    return report(problem_of("this program", error), json);
  } catch (const std::exception& error) {
    return report({ErrorKind::data, "internal error", error.what(), "please report it"}, json);
  }
}

}  // namespace r4::tool
