// Charts over one table of history, with a common time cursor and zoom.
'use strict';

const drawEveryMs = 2000;
const keepLiveRows = 4000;
const ranges = [
  {name: '1 h', seconds: 3600}, {name: 'shift', seconds: 8 * 3600}, {name: 'day', seconds: 86400},
  {name: 'week', seconds: 7 * 86400}, {name: 'month', seconds: 30 * 86400}];
const colours = ['#4e9bd4', '#e07b39', '#54a864', '#c9514a', '#9a74c2', '#8c6d5a', '#d57ab8',
                 '#8a8f95', '#b0a72f', '#35b0bd', '#6f87e0', '#d79a2b'];

let range = ranges[1];
let columns = [];        // names, time first
let table = [];          // rows: Date, then values by column
let probings = [];       // [{axis, time_s, left_um, needed_um}], oldest first
let modes = [];          // [{mode, from_s, to_s}] without compensation, mode no_daemon included
let recordedSince_s = null;
let marks = [];          // [{time_s, text}], newest first
let spacing_s = 10;      // of the rows
let zoomed = null;       // [from, to] in ms if zoomed
let cursorAt = null;     // ms
let drawnAt = 0;
let asked = 0;
const hidden = new Set();  // temperatures switched off in the legend
const charts = new Map();  // by name: {graph, element, names}

const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const isWall = () => document.body.classList.contains('wall');

// Time window: the zoomed part or the range, from the first value on.
function wholeWindow() {
  const end = Date.now();
  const first = table.find(row => row.some((value, c) => c > 0 && value !== null));
  return [Math.max(end - range.seconds * 1000, first ? first[0].getTime() : 0), end];
}

const timeWindow = () => zoomed || wholeWindow();

const absences = () => modes.filter(each => each.mode === 'no_daemon');
const middle_ms = each => 500 * (each.from_s + each.to_s);

// null connects neighbours, NaN breaks the line: at gaps longer than a minute and than three of the
// column's steps, and where no daemon ran.
function withGaps(index) {
  const known = [];
  table.forEach((row, i) => { if (isNumber(row[index])) known.push(i); });
  const steps = known.slice(1).map((row, i) => table[row][0] - table[known[i]][0]).sort((a, b) => a - b);
  const gap_ms = Math.max(60000, 3000 * spacing_s, 3 * (steps[Math.floor(steps.length / 2)] || 0));
  const values = table.map(row => isNumber(row[index]) ? row[index] : null);
  const parts = absences().map(middle_ms);
  for (let k = 1; k < known.length; ++k) {
    const [from, to] = [table[known[k - 1]][0], table[known[k]][0]];
    const isGap = to - from > gap_ms || parts.some(ms => ms >= from && ms <= to);
    if (known[k] - known[k - 1] > 1 && isGap) values[known[k] - 1] = NaN;
  }
  return values;
}

function chartOptions(labels, unit, more) {
  const scale = isWall() ? 1.9 : 1;
  return Object.assign({
    labels: labels, legend: 'never', connectSeparatedPoints: true, drawGapEdgePoints: true,
    strokeWidth: 1.6 * scale, gridLineColor: css('--line'), axisLineColor: css('--line'),
    axisLabelFontSize: 12 * scale, highlightCircleSize: 3, animatedZooms: false, rightGap: 8,
    interactionModel: {mousedown: Dygraph.defaultInteractionModel.mousedown, dblclick: zoomBack},
    highlightCallback: (event, x) => showCursor(x),
    unhighlightCallback: () => showCursor(null),
    zoomCallback: (from, to) => zoomTo([from, to]),
    axes: {x: {pixelsPerLabel: 64 * scale, axisLabelWidth: 56 * scale},
           y: {axisLabelWidth: 58 * scale, pixelsPerLabel: 26 * scale,
               axisLabelFormatter: value => String(+value.toFixed(2)).replace('-', '\u2212') + '\u00a0' + unit}},
    underlayCallback: drawUnder}, more);
}

// Under the lines: times without compensation and marks; for an axis, its claimed error and
// probings.
function drawUnder(canvas, area, graph) {
  const x = ms => graph.toDomXCoord(ms);
  canvas.save();
  canvas.beginPath();
  canvas.rect(area.x, area.y, area.w, area.h);
  canvas.clip();
  canvas.fillStyle = css('--shade');
  for (const each of modes)
    canvas.fillRect(x(each.from_s * 1000), area.y,
                    Math.max(2, x(each.to_s * 1000) - x(each.from_s * 1000)), area.h);
  canvas.fillStyle = css('--faint');
  for (const mark of marks) canvas.fillRect(x(mark.time_s * 1000) - 1, area.y + area.h - 7, 2, 7);
  if (graph.axisName) drawError(canvas, graph);
  canvas.restore();
}

function drawError(canvas, graph) {
  const sd = claimedSd(graph.axisName);
  const index = columns.indexOf(graph.axisName + '_offset_um');
  // No claimed error without compensation.
  const idle = row => modes.some(each => row[0] >= each.from_s * 1000 && row[0] <= each.to_s * 1000);
  const stretches = [[]];
  for (const row of table)
    if (idle(row)) stretches.push([]);
    else if (isNumber(row[index])) stretches[stretches.length - 1].push(row);
  const point = (row, side) => [graph.toDomXCoord(row[0].getTime()), graph.toDomYCoord(row[index] + side * 2 * sd)];
  canvas.fillStyle = css('--band');
  for (const known of stretches.filter(each => sd > 0 && each.length > 1)) {
    canvas.beginPath();
    known.forEach((row, i) => canvas[i ? 'lineTo' : 'moveTo'](...point(row, 1)));
    known.slice().reverse().forEach(row => canvas.lineTo(...point(row, -1)));
    canvas.fill();
  }
  canvas.fillStyle = css('--probing');
  for (const each of probings.filter(each => each.axis === graph.axisName && isNumber(each.needed_um))) {
    canvas.beginPath();
    canvas.arc(graph.toDomXCoord(each.time_s * 1000), graph.toDomYCoord(each.needed_um), isWall() ? 7 : 4, 0, 7);
    canvas.fill();
  }
}

// Claimed standard deviation of an axis now: that of the model and of estimated inputs.
function claimedSd(axis) {
  if (!state || !state.axes) return 0;
  const of = state.axes.find(each => each.name === axis) || {};
  return Math.hypot((state.model.claimed_sd_um || {})[axis] || 0, of.offset_sd || 0);
}

// The scale of an axis contains its error band and probings and spans at least 4 um.
function valueRange(name, [from, to]) {
  const index = columns.indexOf(name + '_offset_um');
  const isIn = ms => ms >= from && ms <= to;
  const values = table.filter(row => isNumber(row[index]) && isIn(row[0].getTime())).map(row => row[index]);
  const sd = claimedSd(name);
  const ends = values.flatMap(value => [value - 2 * sd, value + 2 * sd]);
  for (const each of probings)
    if (each.axis === name && isNumber(each.needed_um) && isIn(each.time_s * 1000)) ends.push(each.needed_um);
  if (ends.length === 0) return null;
  const [low, high] = ends.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [0, 0]);
  const pad = Math.max(0.08 * (high - low), (4 - (high - low)) / 2);
  return [low - pad, high + pad];
}

// Chart of some columns of the table; none if all are unknown.
function draw(name, element, names, unit, window_ms, more) {
  const chart = charts.get(name) || {graph: null};
  const picks = names.map(each => columns.indexOf(each)).filter(index => index > 0);
  element.classList.toggle('empty', picks.length === 0 || table.length < 2);
  if (typeof Dygraph === 'undefined' || picks.length === 0 || table.length < 2) return;
  const series = picks.map(withGaps);
  const data = table.map((row, i) => [row[0], ...series.map(values => values[i])]);
  const labels = ['time', ...picks.map(index => columns[index])];
  const changing = Object.assign({file: data, dateWindow: window_ms},
    more.axisName ? {valueRange: valueRange(more.axisName, window_ms)} : {visibility: names.map(each => !hidden.has(each))});
  if (chart.graph && chart.labelKey === labels.join()) {
    chart.graph.updateOptions(changing);
  } else {
    if (chart.graph) chart.graph.destroy();
    const options = chartOptions(labels, unit, Object.assign({}, more, changing));
    delete options.file;
    chart.graph = new Dygraph(element, data, options);
    chart.graph.axisName = more.axisName;
    chart.labelKey = labels.join();
    chart.line = make('div', null, 'cursor-line');
    chart.graph.graphDiv.append(chart.line);
    chart.graph.updateOptions({});  // redraws with the name of the axis set
  }
  if (!element.hasAttribute('tabindex')) makeReachable(element);
  element.setAttribute('aria-label', more.label + ', ' + (zoomed ? 'part of ' : '') + range.name +
                       '; arrow keys move the time cursor, + and \u2212 zoom, Escape shows all again');
  charts.set(name, chart);
  placeCursors();
}

// Keyboard and touch equivalents of the mouse.
function makeReachable(element) {
  element.tabIndex = 0;
  new ResizeObserver(() => charts.forEach(({graph}) => element.contains(graph.graphDiv) && graph.resize()))
    .observe(element);
  element.setAttribute('role', 'application');
  element.addEventListener('keydown', event => {
    const step = {ArrowLeft: -1, ArrowRight: 1, PageUp: -20, PageDown: 20}[event.key];
    if (step) moveCursor(step);
    else if (event.key === '+') zoomBy(0.5);
    else if (event.key === '-') zoomBy(2);
    else if (event.key === 'Escape') { showCursor(null); zoomBack(); }
    else return;
    event.preventDefault();
  });
  const touch = event => {
    const chart = [...charts.values()].find(each => element.contains(each.graph.graphDiv));
    if (!chart || event.touches.length !== 1) return;
    const left = element.getBoundingClientRect().left;
    showCursor(nearestRow(chart.graph.toDataXCoord(event.touches[0].clientX - left)));
  };
  element.addEventListener('touchstart', touch, {passive: true});
  element.addEventListener('touchmove', touch, {passive: true});
}

function nearestRow(ms) {
  let best = null;
  for (const row of table)
    if (best === null || Math.abs(row[0] - ms) < Math.abs(best - ms)) best = row[0].getTime();
  return best;
}

function moveCursor(step) {
  drawAll();  // includes the newest rows, so that the line stays inside
  const [from, to] = timeWindow();
  const seen = table.map(row => row[0].getTime()).filter(ms => ms >= from && ms <= to);
  if (seen.length === 0) return;
  const at = cursorAt === null ? seen.length - 1 : seen.indexOf(nearestRow(cursorAt)) + step;
  showCursor(seen[Math.max(0, Math.min(seen.length - 1, at))]);
}

const cursorRow = () => table.find(row => row[0].getTime() === cursorAt);

// Common time cursor; the legends show the values at that time.
function showCursor(ms) {
  if (ms === cursorAt) return;
  cursorAt = ms;
  const row = cursorRow();
  const near_ms = spacing_s * 1000;
  const then = row ? [
    ...modes.filter(each => ms >= each.from_s * 1000 && ms <= each.to_s * 1000).map(each => each.mode.replace(/_/g, ' ')),
    ...marks.filter(each => Math.abs(each.time_s * 1000 - ms) <= near_ms).map(each => withUnits(each.text))] : [];
  setText(place('cursor'), row ? 'at ' + clockText(ms / 1000) + then.map(text => ', ' + text).join('') : '');
  for (const [name, part] of axisParts) {
    const value = row ? row[columns.indexOf(name + '_offset_um')] : null;
    const probing = row && probings.find(each => each.axis === name && Math.abs(each.time_s * 1000 - ms) <= near_ms);
    setText(part.then, row ? (isNumber(value) ? 'then ' + signed(value, 1) + ' ' + part.unit : 'then unknown') +
      (probing ? ', probed: ' + fixed(Math.abs(probing.left_um), 1) + ' left' : '') : '');
  }
  showLegend(row);
  placeCursors();
}

function placeCursors() {
  for (const {graph, line} of charts.values()) {
    const area = graph.getArea();
    const at = cursorAt === null ? -1 : graph.toDomXCoord(cursorAt);
    line.hidden = !(at >= area.x && at <= area.x + area.w);
    line.style.transform = 'translateX(' + Math.round(at) + 'px)';
  }
}

function zoomTo(window_ms) {
  zoomed = window_ms;
  place('zoom-back').hidden = zoomed === null;
  drawAll();
}

function zoomBack() { zoomTo(null); }

// Zooms about the cursor, or the middle.
function zoomBy(factor) {
  const [from, to] = timeWindow();
  const about = cursorAt !== null && cursorAt >= from && cursorAt <= to ? cursorAt : (from + to) / 2;
  if (factor < 1 && to - from < 4000) return;
  const part = [about - (about - from) * factor, about + (to - about) * factor];
  const [first, last] = wholeWindow();
  zoomTo(part[0] <= first && part[1] >= last ? null : [Math.max(part[0], first), Math.min(part[1], last)]);
}

function drawAll() {
  drawnAt = performance.now();
  const window_ms = timeWindow();
  for (const [name, part] of axisParts)
    draw('axis ' + name, part.chart, [name + '_offset_um'], part.unit, window_ms,
         {colors: [css('--offset')], axisName: name, label: 'offset of axis ' + name.toUpperCase()});
  if (isWall()) return;
  draw('temperatures', place('temperature-chart'), columns.filter(name => name.endsWith('_degC')), '\u00b0C', window_ms,
       {colors: colours, highlightSeriesOpts: {strokeWidth: 2.6}, label: 'temperatures'});
  showLegend(cursorRow());
}

// A tap hides or shows a line.
function showLegend(row) {
  const names = columns.filter(name => name.endsWith('_degC'));
  const holder = place('temperature-legend');
  if (holder.dataset.key !== names.join()) {
    holder.dataset.key = names.join();
    holder.replaceChildren(...names.map((name, i) => {
      const button = make('button');
      const dot = make('span', '\u25cf');
      dot.style.color = colours[i % colours.length];
      button.append(dot, make('span', ''));
      button.addEventListener('click', () => {
        if (!hidden.delete(name)) hidden.add(name);
        drawAll();
      });
      return button;
    }));
  }
  names.forEach((name, i) => {
    const value = row ? row[columns.indexOf(name)] : null;
    holder.children[i].setAttribute('aria-pressed', String(!hidden.has(name)));
    setText(holder.children[i].children[1],
            ' ' + name.replace(/_degC$/, '') + (isNumber(value) ? ' ' + fixed(value, 1) + ' \u00b0C' : ''));
  });
}

// Shows the history of one sensor only.
function showOnly(sensor) {
  const names = columns.filter(name => name.endsWith('_degC'));
  const alone = names.length - hidden.size === 1 && !hidden.has(sensor + '_degC');
  hidden.clear();
  if (!alone) names.filter(name => name !== sensor + '_degC').forEach(name => hidden.add(name));
  drawAll();
  place('temperatures').scrollIntoView({block: 'start'});
}

// Note if the range begins before the history.
function recordedSince(from_s) {
  const first = table.find(row => row.some((value, c) => c > 0 && value !== null));
  if (!first) return 'no data in this period';
  const since_s = first[0].getTime() / 1000;
  return since_s - from_s > 0.05 * range.seconds ? 'recorded since ' + minuteText(since_s) : '';
}

async function loadHistory() {
  const mine = ++asked;
  try {
    const points = Math.max(200, Math.min(900, Math.round(window.innerWidth)));
    const answer = await fetch(api('history?from=-' + range.seconds + '&points=' + points));
    const history = await answer.json();
    if (mine !== asked) return;
    if (!answer.ok) throw new Error(history.error);
    const names = Object.keys(history.columns);
    columns = names;
    table = history.columns.time_s.map((time_s, i) =>
      names.map((name, c) => c === 0 ? new Date(time_s * 1000) : history.columns[name][i]));
    while (table.length > 2 && table[table.length - 1].every((value, c) => c === 0 || value === null)) table.pop();
    probings = history.probings;
    modes = history.modes;
    recordedSince_s = history.recorded_since_s;
    for (const each of absences()) addEmptyRow(middle_ms(each));
    table.sort((a, b) => a[0] - b[0]);
    marks = history.events;
    spacing_s = history.span_s;
    setText(place('history-note'), recordedSince(history.to_s - range.seconds));
    drawAll();
  } catch (error) {
    setText(place('history-note'), 'no history: ' + error.message);
  }
}

const addEmptyRow = ms => table.push(columns.map((name, c) => c === 0 ? new Date(ms) : null));

// Extends the current time without a daemon, which is not in the history yet.
function addAbsence(now) {
  let last = modes[modes.length - 1];
  if (!last || last.from_s !== now.since_s) {
    last = {mode: 'no_daemon', from_s: now.since_s};
    modes.push(last);
    if (columns.length > 0) addEmptyRow(1000 * now.since_s);
  }
  last.to_s = now.time_s;
  if (performance.now() - drawnAt > drawEveryMs && !document.hidden) drawAll();
}

// Adds the newest values from the states between two loads of the history.
function addLiveRow(now) {
  const spacing_ms = Math.max(1000, Math.min(10000, spacing_s * 1000));
  const last = table.length ? table[table.length - 1][0].getTime() : 0;
  const at = now.time_s * 1000;
  const values = {};
  for (const axis of now.axes) values[axis.name + '_offset_um'] = axis.offset;
  for (const sensor of now.sensors) values[sensor.name + '_degC'] = sensor.fault === 'none' ? temperatureOf(sensor) : null;
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
  zoomed = null;
  place('zoom-back').hidden = true;
  loadHistory();
}

// Draws everything again after a change of the colour scheme.
function redraw() {
  for (const chart of charts.values()) chart.graph.destroy();
  charts.clear();
  drawAll();
}
