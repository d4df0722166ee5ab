// The page of thermocomp-gateway. It gets one stream of states and asks for history; texts come from
// the gateway, which has them from where `thermocomp status` has them.
'use strict';

const silentAfterMs = 2500;      // without a state for so long the gateway counts as gone
const drawEveryMs = 2000;
const keepLiveRows = 4000;
const clockTolerance_s = 30;
const ranges = [
  {name: '1 h', seconds: 3600}, {name: 'shift', seconds: 8 * 3600}, {name: 'day', seconds: 86400},
  {name: 'week', seconds: 7 * 86400}, {name: 'month', seconds: 30 * 86400}];
const colours = ['#4e9bd4', '#e07b39', '#54a864', '#c9514a', '#9a74c2', '#8c6d5a', '#d57ab8',
                 '#8a8f95', '#b0a72f', '#35b0bd', '#6f87e0', '#d79a2b'];

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
const unitText = unit => unit === 'urad' ? '\u00b5rad' : '\u00b5m';

function duration(seconds) {
  if (!isNumber(seconds)) return '\u2013';
  const s = Math.max(0, Math.floor(seconds));
  if (s < 60) return s + ' s';
  if (s < 3600) return Math.floor(s / 60) + ' min';
  if (s < 86400) return Math.floor(s / 3600) + ' h ' + Math.floor(s % 3600 / 60) + ' min';
  return Math.floor(s / 86400) + ' d ' + Math.floor(s % 86400 / 3600) + ' h';
}

function clockText(wall_s) {
  if (!isNumber(wall_s)) return '';
  const at = new Date(wall_s * 1000);
  const sameDay = at.toDateString() === new Date().toDateString();
  const time = at.toLocaleTimeString([], {hour12: false});
  return sameDay ? time : at.toLocaleDateString() + ' ' + time;
}

// ------------------------------------------------------------------ state

let state = null;
let heardAt = performance.now();
let source = null;

function listen() {
  if (source) source.close();
  source = new EventSource('/api/events');
  source.addEventListener('state', event => {
    heardAt = performance.now();
    state = JSON.parse(event.data);
    show(state);
  });
}

function watchGateway() {
  const silent = performance.now() - heardAt > silentAfterMs;
  if (silent) {
    showVerdict({level: 'unknown', answer: 'not known',
                 detail: 'The gateway does not answer for ' + duration((performance.now() - heardAt) / 1000) +
                         '; the values below are old.'});
    document.body.classList.add('stale');
  }
  if (source === null || source.readyState === EventSource.CLOSED) listen();
}

function show(now) {
  setText(place('machine'), now.machine);
  document.title = now.machine + ': ' + now.verdict.answer;
  setText(place('clock'), clockText(now.time_s));
  document.body.classList.toggle('stale', !now.here);
  let detail = now.verdict.detail;
  if (!now.here) detail += ' for ' + duration(now.time_s - now.since_s) + '; the values below are old';
  showVerdict({level: now.verdict.level, answer: now.verdict.answer, detail: detail});
  showProblems(now);
  if (!now.here) return;
  showAxes(now.axes);
  showSensors(now.sensors);
  showBuses(now);
  showModel(now);
  showEvents(now.events);
  setText(place('foot'), 'thermocompd ' + now.version + ', running for ' + duration(now.uptime_s) + ', ' +
          fixed(now.cycle.rate_hz, 0) + ' Hz, ' + (now.cycle.missed || 0) + ' cycles missed' +
          (now.history.enabled ? ', history ' + fixed(now.history.size_MB, 1) + ' MB' : ', no history'));
  addLiveRow(now);
}

function showVerdict(verdict) {
  const element = place('verdict');
  if (element.className !== verdict.level) element.className = verdict.level;
  setText(place('answer'), verdict.answer);
  setText(place('detail'), verdict.detail);
}

function showProblems(now) {
  const problems = now.problems.slice();
  const off_s = now.time_s - Date.now() / 1000;
  if (Math.abs(off_s) > clockTolerance_s)
    problems.push({what: 'the clock of the machine\u2019s computer is ' + duration(Math.abs(off_s)) +
                         (off_s > 0 ? ' ahead of' : ' behind') + ' the one of this device',
                   remedy: 'set the one that is wrong; the compensation itself needs no clock'});
  place('problems').hidden = problems.length === 0;
  const key = JSON.stringify(problems);
  const list = place('problem-list');
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...problems.map(problem => {
    const item = make('li');
    item.append(make('div', problem.what, 'what'));
    if (problem.remedy) item.append(make('div', problem.remedy, 'remedy'));
    return item;
  }));
}

const axisParts = new Map();

function axisCard(name) {
  if (axisParts.has(name)) return axisParts.get(name);
  const card = make('div', null, 'axis');
  const head = make('div', null, 'head');
  const figures = make('div', null, 'figures');
  const part = {card: card, offset: make('span', '', 'offset'),
                displacement: make('span', '', 'displacement'), applied: make('span', ''),
                marks: make('div', '', 'marks'), chart: make('div', null, 'chart'), graph: null};
  figures.append(make('span', 'offset'), part.offset, make('span', 'displacement'),
                 part.displacement, make('span', 'applied'), part.applied);
  head.append(make('span', name.toUpperCase(), 'name'), figures);
  card.append(head, part.marks, part.chart);
  axisParts.set(name, part);
  return part;
}

function axisMarks(axis) {
  const marks = [];
  if (!axis.driven) marks.push('not driven');
  if (axis.mismatch) marks.push('mismatch: ' + axis.mismatch.likely);
  else if (axis.disagrees) marks.push('the read-back disagrees');
  if (axis.at_bound) marks.push('at its bound');
  if (axis.proving) marks.push('proving its sign');
  return marks.join(', ');
}

function showAxes(axes) {
  const cards = axes.map(axis => axisCard(axis.name).card);
  const holder = place('axes');
  if (cards.length !== holder.children.length || cards.some((card, i) => holder.children[i] !== card))
    holder.replaceChildren(...cards);
  for (const axis of axes) {
    const part = axisCard(axis.name);
    const unit = ' ' + unitText(axis.unit);
    setText(part.offset, signed(axis.offset, 1) + unit);
    setText(part.displacement, signed(axis.displacement, 1) + unit);
    setText(part.applied, signed(axis.applied, 1) + unit);
    setText(part.marks, axisMarks(axis));
  }
}

function arrow(rate) {
  if (!isNumber(rate)) return '\u00b7';
  if (rate > 3) return '\u2191';
  if (rate > 0.5) return '\u2197';
  if (rate < -3) return '\u2193';
  if (rate < -0.5) return '\u2198';
  return '\u2192';
}

// Rows are kept and filled anew, so that nothing jumps under a finger.
function rows(holder, count) {
  while (holder.children.length > count) holder.lastChild.remove();
  while (holder.children.length < count) {
    const row = make('div', null, 'row');
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
    let words = bad ? sensor.fault_text + (sensor.fault_remedy ? ' \u2192 ' + sensor.fault_remedy : '')
                    : 'block ' + (sensor.blocks || []).join(', ');
    if (!bad && sensor.suspected)
      words = 'suspected: off by ' + signed(sensor.suspected.size_K, 1) + ' K against its neighbours';
    fillRow(row, 'row' + (bad ? ' wrong' : sensor.suspected ? ' suspect' : ''), [
      sensor.name, fixed(isNumber(sensor.smoothed_degC) ? sensor.smoothed_degC : sensor.raw_degC, 2) +
        ' \u00b0C ' + arrow(rate), words,
      bad ? 'age ' + duration(sensor.age_s) : isNumber(rate) ? signed(rate, 1) + ' K/h' : '']);
  });
}

function showBuses(now) {
  const list = now.buses.map(bus => {
    const silent = bus.units.filter(unit => !unit.answering).map(unit => unit.name);
    return {name: bus.name + ' (' + bus.kind + ')', wrong: !bus.connected || silent.length > 0,
            value: bus.connected ? 'connected' : 'away',
            words: silent.length ? 'silent: ' + silent.join(', ') : bus.connected ? bus.units.length + ' units answer' : bus.last_error};
  });
  const controller = now.controller;
  const signals = Object.entries(controller.signals || {})
    .map(([name, value]) => name + ' ' + fixed(value, 1)).join(', ');
  list.push({name: controller.name + ' (' + controller.kind + ')', wrong: !controller.online,
             value: controller.online ? 'online' : 'offline',
             words: controller.online ? signals : controller.last_error || ''});
  rows(place('buses'), list.length).forEach((row, i) =>
    fillRow(row, 'row' + (list[i].wrong ? ' wrong' : ''), [list[i].name, list[i].value, list[i].words, '']));
}

function showModel(now) {
  const model = now.model;
  const lines = [['file', (model.file || '').replace(/^.*\//, ''), false]];
  const from = model.made_from;
  if (from) lines.push(['made from', (from.runs || []).length + ' runs, ' + fixed(from.hours, 0) + ' h' +
    Object.entries(from.outputs || {}).map(([name, o]) => '; ' + name.replace(/_u(m|rad)$/, '') + ': ' +
      fixed(o.left_out_rms_um, 1) + ' of ' + fixed(o.no_model_rms_um, 1) + ' \u00b5m left').join(''), false]);
  else lines.push(['made from', 'its file does not say', false]);
  if (model.compared === false) lines.push(['compared', 'never, with measured displacement', true]);
  if (model.outside === true)
    lines.push(['valid', 'no: the machine is outside of what it was made from, ' +
                fixed(100 * model.outside_share_24h, 0) + ' % of the last 24 h', true]);
  if (model.outside === false) lines.push(['valid', 'yes', false]);
  const probed = Object.entries(model.probed_rms_um || {}).filter(([, rms]) => isNumber(rms))
    .map(([axis, rms]) => axis + ' ' + fixed(rms, 1) + ' \u00b5m').join(', ');
  if (probed) lines.push(['probings differ by', probed, false]);
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
  const key = events.length ? String(events[0].number) + ':' + events[0].wall_s : 'none';
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...events.map(event => {
    const item = make('li');
    item.append(make('time', clockText(event.wall_s)), make('span', event.text));
    return item;
  }));
  if (events.length === 0) list.append(make('li', 'nothing has happened'));
}

// ------------------------------------------------------------------ charts

let range = ranges[1];
let columns = [];        // names, time first
let table = [];          // rows: Date, then values by column
let temperatures = null; // the chart
let drawnAt = 0;
let liveFrom = 0;

const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function chartOptions(labels, more) {
  return Object.assign({
    labels: labels, legend: 'never', connectSeparatedPoints: true, strokeWidth: 1.6,
    gridLineColor: css('--line'), axisLineColor: css('--line'), axisLabelFontSize: 11,
    highlightCircleSize: 3, animatedZooms: false, includeZero: false, rightGap: 8,
    axes: {y: {axisLabelWidth: 34, pixelsPerLabel: 22}}}, more);
}

// A chart of some columns of the table. Where nothing is known at all there is nothing to draw.
function draw(chart, element, names, more) {
  const picks = names.map(name => columns.indexOf(name)).filter(index => index > 0);
  if (typeof Dygraph === 'undefined' || picks.length === 0 || table.length < 2) return chart;
  const data = table.map(row => [row[0], ...picks.map(index => row[index])]);
  const labels = ['time', ...picks.map(index => columns[index])];
  const end = Date.now();
  const window_ms = [end - range.seconds * 1000, end];
  if (chart && chart.labelKey === labels.join()) {
    chart.updateOptions({file: data, dateWindow: window_ms});
    return chart;
  }
  if (chart) chart.destroy();
  const made = new Dygraph(element, data, chartOptions(labels, Object.assign({dateWindow: window_ms}, more)));
  made.labelKey = labels.join();
  return made;
}

function drawAll() {
  drawnAt = performance.now();
  for (const [name, part] of axisParts)
    part.graph = draw(part.graph, part.chart, [name + '_offset_um', name + '_displacement_um'],
                      {colors: [css('--offset'), css('--displacement')]});
  if (document.body.classList.contains('wall')) return;
  temperatures = draw(temperatures, place('temperature-chart'),
    columns.filter(name => name.endsWith('_degC')),
    {colors: colours, labelsDiv: place('temperature-legend'), legend: 'always',
     legendFormatter: temperatureLegend, highlightSeriesOpts: {strokeWidth: 2.6}});
}

// dygraphs takes HTML here; names are made harmless.
function temperatureLegend(data) {
  const escaped = text => text.replace(/[&<>"]/g, c => '&#' + c.charCodeAt(0) + ';');
  return data.series.filter(series => series.isVisible).map(series =>
    '<span style="color:' + series.color + '">\u25cf</span>\u00a0' +
    escaped(series.label.replace(/_degC$/, '')) + (isNumber(series.y) ? '\u00a0' + fixed(series.y, 1) : '')).join('&ensp;');
}

let asked = 0;
async function loadHistory() {
  const mine = ++asked;
  try {
    const points = Math.max(200, Math.min(900, Math.round(window.innerWidth)));
    const answer = await fetch('/api/history?from=-' + range.seconds + '&points=' + points);
    const told = await answer.json();
    if (mine !== asked) return;
    if (!answer.ok) throw new Error(told.error);
    const names = Object.keys(told.columns);
    columns = names;
    table = told.columns.time_s.map((time_s, i) =>
      names.map((name, c) => c === 0 ? new Date(time_s * 1000) : told.columns[name][i]));
    while (table.length > 2 && table[table.length - 1].every((value, c) => c === 0 || value === null)) table.pop();
    liveFrom = told.span_s;
    setText(place('history-note'), '');
    drawAll();
  } catch (error) {
    setText(place('history-note'), 'no history: ' + error.message);
  }
}

// Between two loads of the history the newest values come from the states.
function addLiveRow(now) {
  const spacing_ms = Math.max(1000, Math.min(10000, liveFrom * 1000));
  const last = table.length ? table[table.length - 1][0].getTime() : 0;
  const at = now.time_s * 1000;
  const values = {};
  for (const axis of now.axes) {
    values[axis.name + '_offset_um'] = axis.offset;
    values[axis.name + '_displacement_um'] = axis.displacement;
  }
  for (const sensor of now.sensors) values[sensor.name + '_degC'] = sensor.fault === 'none' ? sensor.raw_degC : null;
  if (columns.length === 0) columns = ['time_s'];
  for (const name of Object.keys(values))
    if (!columns.includes(name)) {
      columns.push(name);
      table.forEach(row => row.push(null));
    }
  if (at - last < spacing_ms) return;
  table.push(columns.map((name, c) => c === 0 ? new Date(at) : isNumber(values[name]) ? values[name] : null));
  if (table.length > keepLiveRows) table.splice(0, table.length - keepLiveRows);
  if (performance.now() - drawnAt > drawEveryMs && !document.hidden) drawAll();
}

function chooseRange(chosen) {
  range = chosen;
  for (const button of place('ranges').children)
    button.setAttribute('aria-pressed', String(button.textContent === range.name));
  loadHistory();
}

// ------------------------------------------------------------------ commands

async function post(body) {
  const answer = await fetch('/api/command', {method: 'POST', body: JSON.stringify(body),
                                              headers: {'Content-Type': 'application/json'}});
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.error);
  return told;
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
    setText(answer, request.method + ': done');
  } catch (error) {
    setText(answer, request.method + ': ' + error.message);
  }
}

function proveRequest() {
  const axis = prompt('Axis to prove?', state && state.axes.length ? state.axes[0].name : '');
  if (!axis) return null;
  const value_um = Number(prompt('By how many \u00b5m?', '5'));
  return isNumber(value_um) ? {method: 'prove', axis: axis, value_um: value_um} : null;
}

async function offerCommands() {
  try {
    const told = await (await fetch('/api/commands')).json();
    place('commands').hidden = told.commands.length === 0;
    place('command-buttons').replaceChildren(...told.commands.map(method => {
      const button = make('button', method);
      button.addEventListener('click', () => {
        const request = method === 'prove' ? proveRequest() : {method: method};
        if (request) command(request);
      });
      return button;
    }));
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
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
  for (const part of axisParts.values()) {
    if (part.graph) part.graph.destroy();
    part.graph = null;
  }
  if (temperatures) temperatures.destroy();
  temperatures = null;
  drawAll();
});
listen();
setInterval(watchGateway, 500);
chooseRange(ranges[1]);
setInterval(() => { if (!document.hidden) loadHistory(); }, 120000);
offerCommands();
