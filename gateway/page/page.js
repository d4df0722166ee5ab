// Page of thermocomp-gateway. It receives one stream of states and requests history; texts come
// from the gateway, which shares them with `thermocomp status`.
'use strict';

const silentAfterMs = 2500;      // without a state for this long the gateway counts as away
const clockTolerance_s = 30;
const historyCommit_ms = 12000;   // the daemon commits at least every 10 s

const place = id => document.getElementById(id);
const make = (tag, text, className) => {
  const element = document.createElement(tag);
  if (text !== undefined && text !== null) element.textContent = text;
  if (className) element.className = className;
  return element;
};
const setText = (element, text) => {
  if (element.textContent !== text) element.textContent = text;
};
const isNumber = value => typeof value === 'number' && isFinite(value);
const fixed = (value, digits) => isNumber(value) ? value.toFixed(digits).replace('-', '\u2212') : '\u2013';
const signed = (value, digits) => isNumber(value) && value >= 0 ? '+' + fixed(value, digits) : fixed(value, digits);
// A bookmark may contain user and password, which fetch() rejects.
const api = path => location.origin + '/api/' + path;
const unitText = unit => unit === 'urad' ? '\u00b5rad' : '\u00b5m';
const withUnits = text => text.replace(/ u(m|rad)\b/g, ' \u00b5$1').replace(/ degC\b/g, ' \u00b0C');

function duration(seconds) {
  if (!isNumber(seconds)) return '\u2013';
  const s = Math.max(0, Math.floor(seconds));
  if (s < 60) return s + ' s';
  if (s < 3600) return Math.floor(s / 60) + ' min';
  if (s < 86400) return Math.floor(s / 3600) + ' h ' + Math.floor(s % 3600 / 60) + ' min';
  return Math.floor(s / 86400) + ' d ' + Math.floor(s % 86400 / 3600) + ' h';
}

function clockText(wall_s, parts = {hour: '2-digit', minute: '2-digit', second: '2-digit'}) {
  if (!isNumber(wall_s)) return '';
  const at = new Date(wall_s * 1000);
  const sameDay = at.toDateString() === new Date().toDateString();
  const time = at.toLocaleTimeString([], {hour12: false, ...parts});
  return sameDay ? time : at.toLocaleDateString([], {day: 'numeric', month: 'short'}) + ', ' + time;
}

// Time of day, with seconds if less than 2 min ago.
const shortTime = wall_s => Date.now() / 1000 - wall_s < 120 ? clockText(wall_s) : minuteText(wall_s);
const minuteText = wall_s => clockText(wall_s, {hour: '2-digit', minute: '2-digit'});

// ------------------------------------------------------------------ state

let state = null;
let heardAt = performance.now();
let source = null;

function listen() {
  if (source) source.close();
  source = new EventSource(api('events'));
  source.addEventListener('state', event => {
    heardAt = performance.now();
    state = JSON.parse(event.data);
    show(state);
  });
  source.addEventListener('change', event => {
    heardAt = performance.now();
    change(state, JSON.parse(event.data));
    show(state);
  });
}

// Objects are merged; other values replace.
function change(target, changes) {
  for (const [key, value] of Object.entries(changes)) {
    const old = target[key];
    if (value && typeof value === 'object' && !Array.isArray(value) && old && typeof old === 'object')
      change(old, value);
    else target[key] = value;
  }
}

function watchGateway() {
  const silent = performance.now() - heardAt > silentAfterMs;
  if (silent) {
    showVerdict({level: 'unknown', answer: 'not known', meaning: 'the gateway does not answer',
                 since_s: (Date.now() - performance.now() + heardAt) / 1000, advice: 'old values below'});
    document.body.classList.add('stale');
    showCommands({here: false});
  }
  if (source === null || source.readyState === EventSource.CLOSED) listen();
}

function show(now) {
  setText(place('machine'), now.machine);
  setText(place('clock'), clockText(now.time_s));
  document.body.classList.toggle('stale', !now.here);
  showVerdict(now.here || !now.axes ? now.verdict : {...now.verdict, advice: 'last known values below'});
  showProblems(now);
  showCommands(now);
  if (!now.axes) return;
  showAxes(now.axes);
  showHottest(now);
  showSensors(now.sensors);
  showBuses(now);
  showModel(now);
  showEvents(now.events);
  setText(place('foot'), 'thermocompd ' + now.version + ', running for ' + duration(now.uptime_s) + ', ' +
          fixed(now.cycle.rate_hz, 0) + ' Hz, ' + (now.cycle.missed || 0) + ' cycles missed' +
          (now.history.enabled ? ', history ' + fixed(now.history.size_MB, 1) + ' MB' : ', no history'));
  if (now.here) addLiveRow(now);
  else addAbsence(now);
  followEvents(now.events);
}

function showVerdict(verdict) {
  const element = place('verdict');
  if (element.className !== verdict.level) element.className = verdict.level;
  setText(place('answer'), verdict.answer);
  const since = isNumber(verdict.since_s) ? 'since ' + shortTime(verdict.since_s) : '';
  setText(place('detail'), [verdict.meaning, since].filter(Boolean).join(' ') +
                           (verdict.advice ? ': ' + verdict.advice : ''));
  document.title = place('machine').textContent + ': ' + verdict.answer;
}

function showProblems(now) {
  const problems = now.problems.slice();
  const off_s = now.time_s - Date.now() / 1000;
  if (Math.abs(off_s) > clockTolerance_s)
    problems.push({what: 'the clock of the machine\u2019s computer is ' + duration(Math.abs(off_s)) +
                         (off_s > 0 ? ' ahead of' : ' behind') + ' the one of this device',
                   remedy: 'set the wrong one; the compensation needs no clock'});
  place('problems').hidden = problems.length === 0;
  const key = JSON.stringify(problems);
  const list = place('problem-list');
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...problems.map(problem => {
    const item = make('li');
    const what = make(problem.about ? 'a' : 'div', withUnits(problem.what), 'what');
    if (problem.about) what.href = '#' + encodeURIComponent(problem.about);
    item.append(what);
    if (problem.detail) item.append(make('div', withUnits(problem.detail), 'small'));
    const remedy = [problem.remedy, problem.command].filter(Boolean).join(': ');
    if (remedy) item.append(make('div', withUnits(remedy), 'remedy'));
    return item;
  }));
}

const axisParts = new Map();

function axisCard(name) {
  if (axisParts.has(name)) return axisParts.get(name);
  const card = make('div', null, 'axis');
  card.id = 'axis-' + name;
  const head = make('div', null, 'head');
  const part = {card: card, unit: '\u00b5m', offset: make('span', '', 'offset'), bar: make('div', null, 'meter'),
                filled: make('div'), sentence: make('p', '', 'sentence'), marks: make('p', '', 'marks'),
                then: make('span', '', 'then'), chart: make('div', null, 'chart')};
  head.append(make('span', name.toUpperCase(), 'name'), part.then, part.offset);
  part.bar.setAttribute('role', 'meter');
  part.bar.setAttribute('aria-label', 'share of the bound of axis ' + name.toUpperCase());
  part.bar.append(part.filled);
  card.append(head, part.bar, part.sentence, part.marks, part.chart);
  axisParts.set(name, part);
  return part;
}

function axisMarks(axis) {
  const marks = [];
  if (!axis.driven) marks.push('not driven');
  if (axis.mismatch) marks.push('mismatch: ' + axis.mismatch.likely);
  else if (axis.disagrees)
    marks.push('the controller applies ' + signed(axis.applied, 1) + ' ' + unitText(axis.unit));
  if (axis.at_bound) marks.push('at its bound');
  if (axis.proving) marks.push('proving its sign');
  if (state.model.compared === false && !lastProbing(axis)) marks.push('model never compared with a measurement');
  if (state.probe_due && state.probe_due[axis.name]) marks.push('time to probe');
  const warm = (state.warm || {})[axis.name];
  if (warm && warm.minutes > 0)
    marks.push(fixed(warm.remaining_um, 0) + ' ' + unitText(axis.unit) + ' still to come, warm in ' +
               duration(60 * warm.minutes));
  if (warm && warm.minutes === 0) marks.push('warm');
  return marks.join(', ');
}

// "taken out 21 of at most 150 um; 1.2 um left at the last probing, 40 min ago"
function axisSentence(axis, now_s) {
  const unit = '\u00a0' + unitText(axis.unit);
  const of = isNumber(axis.offset_max) ? ' of at most ' + axis.offset_max : '';
  const is = !state.here ? 'last known: ' : axis.proving ? 'moved to show its sign, '
    : state.mode === 'holding' ? 'held since ' + shortTime(state.verdict.since_s) + ' at '
    : state.dry_run ? 'would take out ' : axis.driven ? 'taken out ' : 'not driven, last ';
  const last = lastProbing(axis);
  return is + fixed(Math.abs(axis.offset), 1) + of + unit + (last ?
    '; ' + fixed(Math.abs(last.left_um), 1) + unit + ' left at the last probing, ' + duration(now_s - last.time_s) + ' ago'
    : !isNumber(recordedSince_s) ? '' : now_s - recordedSince_s > 30 * 86400
    ? '; not probed in the last 30 days' : '; not probed since the start of the history, ' + shortTime(recordedSince_s));
}

const lastProbing = axis => probings.filter(each => each.axis === axis.name && isNumber(each.left_um)).pop();

function showAxes(axes) {
  const cards = axes.map(axis => axisCard(axis.name).card);
  const holder = place('axes');
  if (cards.length !== holder.children.length || cards.some((card, i) => holder.children[i] !== card))
    holder.replaceChildren(...cards);
  for (const axis of axes) {
    const part = axisCard(axis.name);
    const share = Math.min(1, Math.abs(axis.offset) / axis.offset_max) || 0;
    part.unit = unitText(axis.unit);
    setText(part.offset, signed(axis.offset, 1) + ' ' + part.unit);
    setText(part.sentence, axisSentence(axis, state.time_s));
    setText(part.marks, axisMarks(axis));
    part.filled.style.width = (100 * share).toFixed(1) + '%';
    part.bar.setAttribute('aria-valuenow', (100 * share).toFixed(0));
    part.bar.classList.toggle('full', axis.at_bound);
  }
}

// Events and probings appear in the history once it is committed.
let newestDrawn = null;
let reload = 0;
function followEvents(events) {
  const number = events.length ? events[0].number : 0;
  if (newestDrawn !== null && number !== newestDrawn) {
    clearTimeout(reload);
    reload = setTimeout(loadHistory, historyCommit_ms);
  }
  newestDrawn = number;
}

// A faulty sensor shows its raw value, for comparison with a thermometer.
const temperatureOf = sensor => isNumber(sensor.raw_degC) ? sensor.raw_degC : sensor.smoothed_degC;

const lastGood = new Map();  // by sensor: {value, time_s}; initially from the history

// A hot sensor keeps its place in the list when it is lost.
function showHottest(now) {
  const list = place('hottest');
  for (const sensor of now.sensors) {
    if (now.here && sensor.fault === 'none')
      lastGood.set(sensor.name, {value: temperatureOf(sensor), time_s: now.time_s});
    else if (!lastGood.has(sensor.name)) {
      const column = columns.indexOf(sensor.name + '_degC');
      const row = table.filter(each => isNumber(each[column])).pop();
      if (row) lastGood.set(sensor.name, {value: row[column], time_s: row[0] / 1000});
    }
  }
  const top = now.sensors.filter(sensor => lastGood.has(sensor.name))
    .sort((a, b) => lastGood.get(b.name).value - lastGood.get(a.name).value).slice(0, 3);
  while (list.children.length < top.length) list.append(make('li'));
  while (list.children.length > top.length) list.lastChild.remove();
  top.forEach((sensor, i) => {
    const {value, time_s} = lastGood.get(sensor.name);
    const isGood = sensor.fault === 'none';
    list.children[i].className = isGood ? '' : 'old';
    setText(list.children[i], sensor.name + ' ' + fixed(value, 1) + ' \u00b0C ' + (isGood ?
      arrow(sensor.trend_K_per_h) : (sensor.jump ? 'in doubt since ' : 'lost since ') + shortTime(time_s)));
  });
}

function arrow(rate) {
  if (!isNumber(rate)) return '\u00b7';
  if (rate > 3) return '\u2191';
  if (rate > 0.5) return '\u2197';
  if (rate < -3) return '\u2193';
  if (rate < -0.5) return '\u2198';
  return '\u2192';
}

// Rows are reused, so that nothing moves while the user taps.
function rows(holder, count) {
  while (holder.children.length > count) holder.lastChild.remove();
  while (holder.children.length < count) {
    const row = make(holder.id === 'sensors' ? 'button' : 'div', null, 'row');
    if (holder.id === 'sensors') row.addEventListener('click', () => showOnly(row.children[0].textContent));
    row.append(make('span', '', 'name'), make('span', '', 'value'), make('span', '', 'small fault'),
               make('span', '', 'small right'));
    holder.append(row);
  }
  return [...holder.children];
}

function fillRow(row, className, texts) {
  if (row.className !== className) row.className = className;
  texts.forEach((text, i) => setText(row.children[i], text));
}

function showSensors(sensors) {
  rows(place('sensors'), sensors.length).forEach((row, i) => {
    const sensor = sensors[i];
    const bad = sensor.fault !== 'none';
    const rate = sensor.trend_K_per_h;
    let words = bad ? (sensor.jump ? 'jumped by ' + signed(sensor.jump.size_K, 1) + ' K' : sensor.fault_text) +
                      (sensor.fault_remedy ? ' \u2192 ' + sensor.fault_remedy : '')
                    : 'block ' + (sensor.blocks || []).join(', ');
    if (!bad && sensor.suspected)
      words = 'suspected: off by ' + signed(sensor.suspected.size_K, 1) + ' K against its neighbours';
    row.id = 'sensor-' + sensor.name;
    row.title = 'show its history';
    fillRow(row, 'row' + (bad && !sensor.settles ? ' wrong' : sensor.suspected ? ' suspect' : ''), [
      sensor.name, fixed(temperatureOf(sensor), 2) +
        ' \u00b0C ' + arrow(rate), words,
      sensor.settles ? '' : bad ? 'age ' + duration(sensor.age_s) : isNumber(rate) ? signed(rate, 1) + ' K/h' : '']);
  });
}

function showBuses(now) {
  const list = now.buses.map(bus => {
    const silent = bus.units.filter(unit => !unit.answering).map(unit => unit.name);
    return {id: 'bus-' + bus.name, name: bus.name + ' (' + bus.kind + ')', wrong: !bus.connected || silent.length > 0,
            value: !bus.connected ? 'away' : silent.length ? 'silent' : 'connected',
            words: bus.connected && silent.length ? silent.join(', ') : bus.connected ? bus.units.length + ' units answer' : bus.last_error};
  });
  const controller = now.controller;
  const signals = Object.entries(controller.signals || {})
    .map(([name, value]) => name + ' ' + fixed(value, 1)).join(', ');
  list.push({id: 'controller-' + controller.name, name: controller.name + ' (' + controller.kind + ')', wrong: !controller.online,
             value: controller.online ? 'online' : 'offline',
             words: controller.online ? signals : controller.last_error || ''});
  rows(place('buses'), list.length).forEach((row, i) => {
    row.id = list[i].id;
    fillRow(row, 'row' + (list[i].wrong ? ' wrong' : ''), [list[i].name, list[i].value, list[i].words, '']);
  });
}

function showModel(now) {
  const model = now.model;
  const lines = [['file', (model.file || '').replace(/^.*\//, ''), false]];
  const from = model.made_from;
  if (from) lines.push(['made from', (from.runs || []).length + ' runs, ' + fixed(from.hours, 0) + ' h' +
    Object.entries(from.outputs || {}).map(([name, o]) => '; ' + name.replace(/_u(m|rad)$/, '') + ': ' +
      fixed(o.left_out_rms_um, 1) + ' of ' + fixed(o.no_model_rms_um, 1) + ' \u00b5m left').join(''), false]);
  else lines.push(['made from', 'not stated in its file', false]);
  if (model.compared === false) lines.push(['compared', 'never, with measured displacement', true]);
  if (model.outside === true)
    lines.push(['valid', 'no: the machine is outside its domain, ' +
                fixed(100 * model.outside_share_24h, 0) + ' % of the last 24 h', true]);
  if (model.outside === false) lines.push(['valid', 'yes', false]);
  const probed = Object.entries(model.probed_rms_um || {}).filter(([, rms]) => isNumber(rms))
    .map(([axis, rms]) => axis + ' ' + fixed(rms, 1) + ' \u00b5m').join(', ');
  if (probed) lines.push(['probings differ by', probed, false]);
  const candidate = now.candidate;
  if (candidate) {
    const worse = candidate.worse_probability > candidate.better_probability;
    const count = candidate.probings;
    const score = Object.entries(candidate.rms_um).map(([axis, rms]) => axis + ' leaves ' + fixed(rms.candidate, 1) +
      ' of ' + fixed(rms.model, 1) + ' \u00b5m, ');
    lines.push(['candidate', (candidate.file || '').replace(/^.*\//, '') + (candidate.problem ?
      ' does not run: ' + candidate.problem : !count ? ', not probed yet' : ': ' + score.join('') + count +
      (count === 1 ? ' probing, ' : ' probings, ') + (worse ? 'worse' : 'better') + ' with ' +
      fixed(100 * Math.max(candidate.better_probability, candidate.worse_probability), 0) + ' %'),
      Boolean(candidate.problem)]);
  }
  if (now.reference)
    lines.push(['reference', now.reference.lost ? 'lost' : now.reference.wall_s ?
                clockText(now.reference.wall_s) : now.reference.by || 'not known when', Boolean(now.reference.lost)]);
  const key = JSON.stringify(lines);
  const list = place('model');
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...lines.flatMap(([name, text, wrong]) =>
    [make('dt', name), make('dd', text, wrong ? 'wrong' : '')]));
}

function showEvents(events) {
  const list = place('events');
  const key = JSON.stringify(events);
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...events.map(event => {
    const item = make('li');
    const clock = event.wall_s - event.from_s < 120 ? clockText : minuteText;
    item.append(make('time', minuteText(event.wall_s)), make('span', withUnits(event.text) +
      (isNumber(event.from_s) ? ', ' + clock(event.from_s) + ' to ' + clock(event.wall_s) : '')));
    return item;
  }));
  if (events.length === 0) list.append(make('li', 'no events'));
}

// ------------------------------------------------------------------ commands

async function post(body) {
  const answer = await fetch(api('command'), {method: 'POST', body: JSON.stringify(body),
                                              headers: {'Content-Type': 'application/json'}});
  const result = await answer.json();
  if (!answer.ok) throw new Error(result.error);
  return result;
}

function confirmed(text) {
  return new Promise(resolve => {
    const dialog = place('confirm');
    place('confirm-text').textContent = text;
    place('confirm-yes').onclick = () => { dialog.close(); resolve(true); };
    place('confirm-no').onclick = () => { dialog.close(); resolve(false); };
    dialog.oncancel = () => resolve(false);
    dialog.showModal();
  });
}

async function command(request) {
  const answer = place('command-answer');
  try {
    const asked = await post(request);
    if (!await confirmed(asked.text)) return;
    setText(answer, 'sent');
    await post({token: asked.token});
    setText(answer, offered.names[request.method] + ': done');
  } catch (error) {
    setText(answer, offered.names[request.method] + ': ' + error.message);
  }
}

function refuse(why) {
  setText(place('command-answer'), why);
  return null;
}

function proveRequest() {
  const axes = state ? state.axes.map(each => each.name) : [];
  const asked = prompt('Axis to prove: ' + axes.join(', ') + '?', axes[0] || '');
  if (!asked) return null;
  const axis = axes.find(name => name.toLowerCase() === asked.trim().toLowerCase());
  if (!axis) return refuse('there is no axis ' + asked);
  const size = prompt('By how many \u00b5m?', '5');
  if (!size) return null;
  const value_um = Number(size.replace(',', '.'));
  return isNumber(value_um) && value_um ? {method: 'prove', axis: axis, value_um: value_um} : refuse(size + ' is no number other than 0');
}

let offered = {commands: [], names: {}};

// One button per available command; `why`: reason if disabled.
function buttonsOf(now) {
  const jumped = (now.sensors || []).filter(each => each.jump);
  return offered.commands.flatMap(method => {
    const button = {method: method, text: offered.names[method], why: now.here ? '' : 'not now'};
    if (method === 'accept') return jumped.map(({name}) => ({...button, sensor: name, text: button.text + ' ' + name}));
    if (method === 'reference' && now.here) {
      const [first, ...more] = now.reference.objections;
      button.why = (first || '') + (more.length ? '; and ' + more.length + ' more' : '');
    }
    return [button];
  });
}

function showCommands(now) {
  const buttons = buttonsOf(now);
  const holder = place('command-buttons');
  const key = JSON.stringify([now.here, buttons]);
  if (holder.dataset.key === key) return;
  if (holder.dataset.here !== String(now.here)) setText(place('command-answer'), '');
  Object.assign(holder.dataset, {key: key, here: now.here});
  place('commands').hidden = buttons.length === 0;
  rebuild(holder, buttons);
  setText(place('command-why'), buttons.filter(each => now.here && each.why)
    .map(each => each.text + ', not now: ' + withUnits(each.why)).join('. '));
}

// Buttons are kept if the commands are unchanged, so that nothing moves while the user taps.
function rebuild(holder, buttons) {
  const names = buttons.map(each => each.text).join();
  if (holder.dataset.names !== names)
    holder.replaceChildren(...buttons.map(({method, sensor, text}) => {
      const button = make('button', text);
      button.addEventListener('click', () => {
        const request = method === 'prove' ? proveRequest() : {method: method, sensor: sensor};
        if (request) command(request);
      });
      return button;
    }));
  holder.dataset.names = names;
  buttons.forEach((each, i) => { holder.children[i].disabled = each.why !== ''; });
}

async function offerCommands() {
  try {
    offered = await (await fetch(api('commands'))).json();
    for (const [method, name] of Object.entries(offered.names)) offered.names[method] = name[0].toUpperCase() + name.slice(1);
    place('body').hidden = !offered.body;
    place('report').hidden = !offered.report;
    if (state) showCommands(state);
  } catch (error) {
    place('commands').hidden = true;
  }
}

// ------------------------------------------------------------------ start

if (new URLSearchParams(location.search).has('wall')) document.body.classList.add('wall');
place('ranges').append(...ranges.map(each => {
  const button = make('button', each.name);
  button.addEventListener('click', () => chooseRange(each));
  return button;
}));
place('zoom-in').addEventListener('click', () => zoomBy(0.5));
place('zoom-out').addEventListener('click', () => zoomBy(2));
place('zoom-back').addEventListener('click', zoomBack);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
listen();
setInterval(watchGateway, 500);
chooseRange(ranges[1]);
setInterval(() => { if (!document.hidden) loadHistory(); }, 120000);
offerCommands();
