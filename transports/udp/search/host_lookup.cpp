// SPDX-License-Identifier: GPL-3.0-or-later
#include "host_lookup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <asio/ip/udp.hpp>
#include <asio/post.hpp>
#include <exception>
#include <future>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

namespace r4 {
namespace {

// Calls `done(answer)` in a detached thread, which may outlive all objects except the arguments.
template <class Question, class Done>
void ask_in_a_thread(Question question, Done done) {
  // An exception that leaves the thread would end the program, which may be driving.
  const auto ask = [question] {
    try {
      return question();
    } catch (const std::exception& error) {
      return FoundHost{{}, error.what()};
    }
  };
  try {
    std::thread([ask, done] { done(ask()); }).detach();
  } catch (const std::system_error& error) {
    done(FoundHost{{}, error.what()});
  }
}

}  // namespace

FoundHost HostLookup::ask_system(const std::string& host) {
  asio::io_context io(1);
  asio::error_code error;
  const auto results = asio::ip::udp::resolver(io).resolve(host, "", error);
  FoundHost found;
  for (const auto& result : results) found.addresses.push_back(result.endpoint().address());
  if (found.addresses.empty()) found.reason = error.message();
  return found;
}

asio::ip::address HostLookup::find(const std::string& host, const std::string& thing) const {
  if (is_address(host)) return address_of({{asio::ip::make_address(host)}, ""}, host, thing);
  const auto answer = std::make_shared<std::promise<FoundHost>>();
  std::future<FoundHost> found = answer->get_future();
  const auto question = [ask = resolve, host] { return ask(host); };
  ask_in_a_thread(question, [answer](FoundHost each) { answer->set_value(std::move(each)); });
  if (found.wait_for(patience) != std::future_status::ready) {
    return address_of({{}, "no name server answers"}, host, thing);
  }
  return address_of(found.get(), host, thing);
}

asio::ip::address address_of(const FoundHost& found, const std::string& host,
                             const std::string& thing) {
  if (found.problem) {
    throw Error(found.problem->kind, thing, found.problem->reason, found.problem->fix);
  }
  if (found.addresses.empty()) {
    throw Error(ErrorKind::open, thing,
                fmt::format("there is no host '{}' ({})", host, found.reason),
                "check the name, or give the IP address");
  }
  const auto v4 = std::find_if(found.addresses.begin(), found.addresses.end(),
                               [](const asio::ip::address& each) { return each.is_v4(); });
  asio::ip::address address = v4 != found.addresses.end() ? *v4 : found.addresses.front();
  if (address.is_multicast() || address == asio::ip::address_v4::broadcast()) {
    throw Error(ErrorKind::usage, thing, host + " is the address of many, not of one",
                "give the IP address of the board itself");
  }
  return address;
}

bool is_address(const std::string& host) {
  asio::error_code error;
  asio::ip::make_address(host, error);
  return !error;
}

// The asker and its loop may be destroyed before the answer arrives.
struct HostWatch::Asked {
  std::mutex mutex;
  HostWatch* asker = nullptr;
};

HostWatch::HostWatch(asio::io_context& io, HostLookup lookup)
    : io_(io), lookup_(std::move(lookup)), timer_(io) {}

void HostWatch::start(Question question, bool known, OnFound on_found) {
  stop();
  what_to_ask_ = std::move(question);
  known_ = known;
  on_found_ = std::move(on_found);
  if (!known) ask();
  wait();
}

void HostWatch::stop() {
  waiting_.cancel();
  timer_.cancel();
  heard_ = true;
  on_found_ = nullptr;
  if (!asked_) return;
  {
    const std::lock_guard lock(asked_->mutex);
    asked_->asker = nullptr;
  }
  asked_.reset();
}

void HostWatch::ask() {
  if (asked_) return;
  asked_ = std::make_shared<Asked>();
  asked_->asker = this;
  ask_in_a_thread(what_to_ask_, [asked = asked_](const FoundHost& found) {
    const std::lock_guard lock(asked->mutex);
    if (asked->asker == nullptr) return;
    asio::post(asked->asker->io_, [asked, found] {
      HostWatch* const asker = asked->asker;  // only the thread of the loop writes it
      if (asker == nullptr) return;
      asker->asked_.reset();
      const OnFound on_found = asker->on_found_;  // the callback may stop the watch
      on_found(found);
    });
  });
}

// The timer also keeps the loop running while an answer is under way.
void HostWatch::wait() {
  timer_.expires_after(known_ ? lookup_.silence : lookup_.retry);
  timer_.async_wait(waiting_.handler([this] {
    const bool silent = !known_ || !heard_;
    heard_ = !known_;
    wait();
    if (!silent) return;
    if (what_to_ask_) return ask();
    const OnFound on_found = on_found_;  // the callback may stop the watch
    on_found({});
  }));
}

}  // namespace r4
