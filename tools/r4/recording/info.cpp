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
    R"(For each recording: its start and end. For each path: the rate of its states, damaged and lost
datagrams, the safe states and their duration, and gaps, which are times longer than a second
without a datagram of the board. A file of another format that r4 convert reads is shown as the
recording that it would become. r4 info reads all readable parts. It reports the number and place of
each damaged line, and the exit code is then 1. If a recording program was killed, the last line may
be incomplete.

Examples:
  r4 info drive.r4log
  r4 info robot-*.r4log.zst --json | jq .paths
  zstdcat robot-00007.r4log.zst | r4 info -

Exit codes: 0 all parts could be read; 1 some parts could not be read, or the file is not a
recording; 4, 5 the file cannot be read.)";

}  // namespace

void add_info(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<InfoOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "info", "Summarise a recording", info_footer, options, info);
  add_texts(*command, "FILE", options->files, "recordings, or - for standard input", file_type,
            Need::required);
  add_json(*command, options->json, "print JSON, one object for each file");
}

}  // namespace r4::tool
