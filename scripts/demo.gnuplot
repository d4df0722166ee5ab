# True displacement at the tool of the demonstration's machine.
#   gnuplot -e "truth='...'; events='...'; picture='...'; format='png'" demo.gnuplot
set datafile separator ","
set datafile columnheaders
if (format eq "png") {
  set terminal pngcairo size 1100,1350 font "DejaVu Sans,11" background rgb "white"
} else {
  set terminal svg size 1100,1350 font "DejaVu Sans,14" background rgb "white"
}
set output picture

hours = 8
set xrange [0:hours]
set xtics 1
set grid back lc rgb "#dddddd"
set lmargin 9
set rmargin 22
set key outside right top Left reverse samplen 2

# Events: a grey stripe each, with its name above the first panel.
set datafile separator whitespace
set datafile nocolumnheaders
stats events using 1 nooutput
count = STATS_records
array begin[count + 1]
array end[count + 1]
array name[count + 1]
stats events using (begin[int(column(0)) + 1] = column(1)) nooutput
stats events using (end[int(column(0)) + 1] = column(2)) nooutput
stats events using (name[int(column(0)) + 1] = strcol(3), 1) nooutput
do for [i = 1:count] {
  last = end[i] - begin[i] > 0.04 ? end[i] : begin[i] + 0.04
  set object i rectangle from begin[i], graph 0 to last, graph 1 \
    fillcolor rgb "#c8c8c8" fillstyle solid 0.6 noborder behind
  set label i name[i] at begin[i], graph 1.03 left font ",9" textcolor rgb "#505050"
}
set datafile separator ","
set datafile columnheaders

x_colour = "#1f6fb4"
y_colour = "#d95f02"
z_colour = "#1b9e77"

# A common scale for the errors without and with compensation.
low = 0
high = 0
set xrange [*:*]
do for [axis in "x y z"] {
  stats truth using (column(axis."_error_um")):(column(axis."_error_um")-column(axis."_offset_um")) nooutput
  low = STATS_min_x < low ? STATS_min_x : low
  low = STATS_min_y < low ? STATS_min_y : low
  high = STATS_max_x > high ? STATS_max_x : high
  high = STATS_max_y > high ? STATS_max_y : high
}

set xrange [0:hours]

set multiplot layout 4,1
set yrange [low:high]
set ylabel "displacement, um"
set title "Tool against work since the start of the shift, without compensation" offset 0,1
plot truth using (column("time_s")/3600):(column("x_error_um")-column("x_offset_um")) \
       with lines lw 2 lc rgb x_colour title "x", \
     truth using (column("time_s")/3600):(column("y_error_um")-column("y_offset_um")) \
       with lines lw 2 lc rgb y_colour title "y", \
     truth using (column("time_s")/3600):(column("z_error_um")-column("z_offset_um")) \
       with lines lw 2 lc rgb z_colour title "z"

do for [i = 1:count] { unset label i }
set title "The same with the offsets that the controller applied" offset 0,0
plot truth using (column("time_s")/3600):"x_error_um" with lines lw 1.5 lc rgb x_colour title "x", \
     truth using (column("time_s")/3600):"y_error_um" with lines lw 1.5 lc rgb y_colour title "y", \
     truth using (column("time_s")/3600):"z_error_um" with lines lw 1.5 lc rgb z_colour title "z"

set title "Height of the head on the column, which the daemon reads: the model depends on it"
set ylabel "mm"
set yrange [0:500]
plot truth using (column("time_s")/3600):"z_mm" with lines lw 1.5 lc rgb "#555555" title "z"
set yrange [*:*]

set title "Temperatures"
set ylabel "degC"
set xlabel "hours of the shift"
places = "bed_front bed_rear table saddle column_left column_right head spindle_front spindle_rear"
colours = "#1f6fb4 #6baed6 #1b9e77 #a6761d #e7298a #f5a6c8 #555555 #d95f02 #7b3fa0"
plot for [i = 1:words(places)] \
  truth using (column("time_s")/3600):word(places, i)."_degC" with lines lw 1.5 lc rgb word(colours, i) \
  title system("echo ".word(places, i)." | tr _ ' '")
unset multiplot
