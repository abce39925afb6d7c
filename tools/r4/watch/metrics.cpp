// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <asio/post.hpp>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../boards/board_set.hpp"
#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "../web/server/server.hpp"
#include "board_metrics.hpp"
#include "r4link/async_board.hpp"
#include "r4link/can/async_listener.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/discovery/url.hpp"

namespace r4::tool {
namespace {

struct MetricsOptions {
  std::vector<std::string> urls;
  std::string listen = "127.0.0.1:9618";
  std::vector<std::string> hosts;
  std::optional<Milliseconds> duration;
  std::string key;
  bool json = false;
};

web::ServerOptions server_options(const MetricsOptions& options) {
  web::ServerOptions server;
  server.address = web::listen_address(options.listen);
  server.page = false;
  for (const std::string& each : options.hosts) server.hosts.push_back(web::host_name(each));
  return server;
}

class BusMetrics {
 public:
  BusMetrics(asio::io_context& io, const CanInterface& interface)
      : name_(interface.name), listener_(io, interface.name, rate_of(interface)) {}

  void describe(MetricFamilies& out) const {
    std::map<std::string, std::uint64_t> busy_ns;
    for (const auto& [id, traffic] : listener_.survey().traffic()) {
      const CanIdMeaning meaning = classify(id);
      const bool of_a_board = id != CanSurvey::extended_ids && meaning.kind != CanIdKind::other &&
                              meaning.kind != CanIdKind::emergency_stop;
      busy_ns[of_a_board ? std::to_string(meaning.node) : "other"] += traffic.busy_ns;
    }
    for (const auto& [node, ns] : busy_ns) {
      out.counter("r4_can_busy_seconds_total",
                  "Time for which frames of a node occupied the bus; its rate is the load, 0 to 1.",
                  {{"interface", name_}, {"node", node}}, static_cast<double>(ns) / 1e9);
    }
  }

 private:
  // A vcan has no bit rate: assume R4's usual one.
  static CanBitRate rate_of(const CanInterface& interface) {
    constexpr std::uint32_t usual = 1'000'000;
    return {interface.bit_rate != 0 ? interface.bit_rate : usual, interface.data_bit_rate};
  }

  const std::string name_;
  CanListener listener_;
};

class MetricsCommand final : web::ServerEvents {
 public:
  explicit MetricsCommand(const MetricsOptions& options)
      : boards_(options.urls, watching(options.key)), server_(server_options(options), *this) {
    for (const SetBoard& each : boards_) {
      for (const std::string& path : split_paths(each.url)) {
        const Url url = Url::parse(path);
        if (url.scheme() == "can") interfaces_.try_emplace(can_interface_of(url));
      }
    }
  }

  int run(const MetricsOptions& options) {
    boards_.open();
    for (auto& [name, bus] : interfaces_) {
      bus = std::make_unique<BusMetrics>(boards_.io(), can_interface(name));
    }
    server_.start();
    boards_.end_by_signal(options.duration);
    const std::string url = fmt::format("http://{}/metrics", server_.address().text());
    if (options.json) {
      print_line({{"type", "listening"}, {"url", url}, {"boards", boards_.size()}});
    } else {
      print_text("{} of {} boards\n", url, boards_.size());
    }
    boards_.run();
    return 0;
  }

 private:
  // Called on the server's thread. All clients are HTTP requests for the metrics.
  void on_open(web::ClientId, web::Protocol) override {}
  void on_message(web::ClientId, web::Protocol, std::string) override {}
  void on_closed(web::ClientId, web::Protocol) override {}
  void on_metrics() override {
    asio::post(boards_.io(), [this] {
      MetricFamilies families;
      for (const SetBoard& each : boards_) describe(each, families);
      for (const auto& [name, bus] : interfaces_) bus->describe(families);
      server_.set_metrics(families.text());
    });
  }

  BoardSet boards_;
  std::map<std::string, std::unique_ptr<BusMetrics>> interfaces_;
  web::Server server_;
};

int serve_metrics(const MetricsOptions& options) { return MetricsCommand(options).run(options); }

constexpr const char* metrics_footer =
    R"(Answers Prometheus at http://127.0.0.1:9618/metrics (docs/how-to/metrics.md). For each board:
whether its datagrams arrive, why its outputs are off, rate, loss, round trip, age and jitter of its
states, analog inputs. For each CAN interface: the load by each board. r4 metrics only watches, as
r4 monitor does, and does not take control. With --listen 0.0.0.0:9618 it also answers other
computers, which can only read. Requests must name the address; --host adds a name of this computer,
or of a proxy.

Examples:
  r4 metrics udp://192.168.0.125
  r4 metrics 'udp://10.0.0.{1-30}?listen=0' 'can://can0?node=0-7'
  r4 metrics serial:auto --listen 0.0.0.0:9618 --host robot.example
  curl -s http://127.0.0.1:9618/metrics | grep r4_safe

Exit codes: 0 ended by --duration or Ctrl-C; 2 usage; 4 a transport or the port cannot be opened; 5
permission denied.)";

}  // namespace

void add_metrics(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<MetricsOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "metrics", "Serve metrics of boards to Prometheus",
                     metrics_footer, options, serve_metrics);
  add_boards(*command, options->urls);
  add_text(*command, "--listen", options->listen,
           "address for HTTP requests (default 127.0.0.1:9618)", "ADDRESS:PORT");
  add_repeated(*command, "--host", options->hosts,
               "another name for requests: of this computer, or of a proxy", "NAME");
  add_duration(*command, options->duration);
  add_key(*command, options->key);
  add_json(*command, options->json, "print its URL as JSON");
}

}  // namespace r4::tool
