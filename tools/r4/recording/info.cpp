// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>
#include <string>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "formats.hpp"
#include "r4link/error.hpp"
#include "read_file.hpp"
#include "recording_summary.hpp"

namespace r4::tool {
namespace {

struct InfoOptions {
  std::vector<std::string> files;
  bool json = false;
};

int info(const InfoOptions& options) {
  bool any_damage = false;
  for (const std::string& file : options.files) {
    RecordingSummary summary;
    read_file(file, summary);
    if (options.json) {
      print_line(summary.json(file));
    } else {
      print_text(summary.text(called(file)));
    }
    any_damage = any_damage || summary.damaged();
  }
  return any_damage ? static_cast<int>(ErrorKind::data) : 0;
}

constexpr const char* info_footer =
    R"(Of each recording: from when to when; of each path the rate of its states, what was damaged and lost,
the safe states and for how long, and gaps: times longer than a second in which the board said
nothing. A file of another format that r4 convert reads is shown as the recording that it makes.
Everything that can be read is read; where a line is damaged, its number and place are told, and the
exit code is 1. The last line is torn where a recording was killed in the midst of it.

Examples:
  r4 info drive.r4log
  r4 info robot-*.r4log.zst --json | jq .paths
  zstdcat robot-00007.r4log.zst | r4 info -

Exit codes: 0 all of it could be read; 1 some could not, or it is not a recording; 4, 5 the file cannot be
read.)";

}  // namespace

void add_info(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<InfoOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "info", "Summarise a recording", info_footer, options, info);
  add_texts(*command, "FILE", options->files, "recordings; - is the standard input", file_type,
            Need::required);
  add_json(*command, options->json, "print JSON, one object for each file");
}

}  // namespace r4::tool
