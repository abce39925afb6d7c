// SPDX-License-Identifier: GPL-3.0-or-later
// r4 metrics: its command line.
#include <memory>

#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "metrics_server.hpp"

namespace r4::tool {
namespace {

constexpr const char* metrics_footer =
    R"(Answers Prometheus at http://127.0.0.1:9618/metrics (docs/metrics.md): of each board whether it is heard,
why its outputs are off, rate, loss, round trip, age and jitter of its states, analog inputs; of each CAN
interface how busy it is, and for which boards. It watches, as r4 monitor does, and takes no control.
--listen 0.0.0.0:9618 answers other computers, too: anybody there may read, and nobody may do more.

Examples:
  r4 metrics udp://192.168.0.125
  r4 metrics 'udp://10.0.0.{1-30}?listen=0' 'can://can0?node=0-7'
  curl -s http://127.0.0.1:9618/metrics | grep r4_safe

Exit codes: 0 ended by --duration or Ctrl-C; 2 usage; 4 a transport or the port cannot be opened; 5 permission
denied.)";

}  // namespace

void add_metrics(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<MetricsOptions>();
  CLI::App* const command = add_subcommand(root, chosen, "metrics", "Tell Prometheus of boards",
                                           metrics_footer, options, serve_metrics);
  add_boards(*command, options->urls);
  add_text(*command, "--listen", options->listen, "where it answers (default 127.0.0.1:9618)",
           "HOST:PORT");
  add_duration(*command, options->duration);
  add_key(*command, options->key);
  add_json(*command, options->json, "print where it listens as JSON");
}

}  // namespace r4::tool
