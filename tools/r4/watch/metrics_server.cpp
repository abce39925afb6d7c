// SPDX-License-Identifier: GPL-3.0-or-later
#include "metrics_server.hpp"

#include <fmt/format.h>
#include <prometheus/collectable.h>
#include <prometheus/exposer.h>
#include <prometheus/metric_family.h>

#include <array>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/run_end.hpp"
#include "board_metrics.hpp"
#include "r4link/async_board.hpp"
#include "r4link/error.hpp"
#include "transports/can/can_interface.hpp"
#include "transports/can/can_listener.hpp"
#include "transports/url.hpp"
#include "transports/url_pattern.hpp"

namespace r4::tool {
namespace {

using prometheus::MetricFamily;

// Then the answer tells of no board, which is what `absent(r4_up)` looks for.
constexpr std::chrono::seconds longest_collection{2};

// A CAN interface: how long it was busy, and for which boards.
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
      out.counter(
          "r4_can_busy_seconds_total",
          "For how long frames to and from a node took the bus; its rate is the load, 0 to 1.",
          {{"interface", name_}, {"node", node}}, static_cast<double>(ns) / 1e9);
    }
  }

 private:
  // A vcan has no bit rate: it counts as the one that R4 is built for.
  static CanBitRate rate_of(const CanInterface& interface) {
    constexpr std::uint32_t usual = 1'000'000;
    return {interface.bit_rate != 0 ? interface.bit_rate : usual, interface.data_bit_rate};
  }

  const std::string name_;
  CanListener listener_;
};

// What the threads of the HTTP server ask, answered by the thread of the boards.
class Metrics final : public prometheus::Collectable {
 public:
  explicit Metrics(asio::io_context& io) : io_(io) {}

  void add(MetricBoard board) { boards_.push_back(std::move(board)); }
  void add(const BusMetrics& bus) { buses_.push_back(&bus); }

  std::vector<MetricFamily> Collect() const override {
    const auto answer = std::make_shared<std::promise<std::vector<MetricFamily>>>();
    auto told = answer->get_future();
    asio::post(io_, [this, answer] { answer->set_value(describe_all()); });
    if (told.wait_for(longest_collection) != std::future_status::ready) return {};
    return told.get();
  }

 private:
  std::vector<MetricFamily> describe_all() const {
    MetricFamilies families;
    for (const MetricBoard& board : boards_) r4::tool::describe(board, families);
    for (const BusMetrics* bus : buses_) bus->describe(families);
    return families.take();
  }

  asio::io_context& io_;
  std::vector<MetricBoard> boards_;
  std::vector<const BusMetrics*> buses_;
};

std::unique_ptr<prometheus::Exposer> serve(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  const bool valid = colon != std::string::npos && colon != 0 && colon + 1 != address.size() &&
                     address.find(',') == std::string::npos;
  if (!valid) {
    throw Error(ErrorKind::usage, "--listen " + address, "is not HOST:PORT",
                "write it as in 127.0.0.1:9618, or 0.0.0.0:9618 for other computers");
  }
  try {
    return std::make_unique<prometheus::Exposer>(std::vector<std::string>{
        "listening_ports", address, "num_threads", "2", "request_timeout_ms", "5000"});
  } catch (const std::exception&) {  // it does not say why
    throw Error(
        ErrorKind::open, "--listen " + address, "cannot be listened at",
        "see whether another program has that port, and that the address is this computer's");
  }
}

class MetricsServer {
 public:
  explicit MetricsServer(const MetricsOptions& options)
      : run_end_(io_), metrics_(std::make_shared<Metrics>(io_)) {
    BoardOptions board_options = with_key(options.key);
    board_options.role = BoardRole::watch;
    board_options.session.arming = Arming::off;  // it drives nothing
    for (const PatternUrl& each : expand_urls(options.urls)) {
      boards_.push_back(std::make_unique<AsyncBoard>(io_, each.url, board_options));
      metrics_->add({each.url, boards_.back().get()});
      for (const std::string& wire : split_wires(each.url)) {
        const Url url = Url::parse(wire);
        if (url.scheme() == "can") interfaces_.try_emplace(can_interface_of(url));
      }
    }
  }

  int run(const MetricsOptions& options) {
    for (const auto& board : boards_) board->open();
    for (auto& [name, bus] : interfaces_) {
      bus = std::make_unique<BusMetrics>(io_, can_interface(name));
      metrics_->add(*bus);
    }
    const std::unique_ptr<prometheus::Exposer> exposer = serve(options.listen);
    exposer->RegisterCollectable(metrics_);
    run_end_.watch(options.duration);
    const std::string host = options.listen.substr(0, options.listen.rfind(':'));
    const std::string url =
        fmt::format("http://{}:{}/metrics", host, exposer->GetListeningPorts().front());
    if (options.json) {
      print_line({{"type", "listening"}, {"url", url}, {"boards", boards_.size()}});
    } else {
      fmt::print("{} of {} boards\n", url, boards_.size());
      std::fflush(stdout);
    }
    io_.run();
    return 0;
  }

 private:
  asio::io_context io_{1};
  RunEnd run_end_;
  std::vector<std::unique_ptr<AsyncBoard>> boards_;
  std::map<std::string, std::unique_ptr<BusMetrics>> interfaces_;
  std::shared_ptr<Metrics> metrics_;
};

}  // namespace

int serve_metrics(const MetricsOptions& options) { return MetricsServer(options).run(options); }

}  // namespace r4::tool
